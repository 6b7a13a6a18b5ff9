//! Friction and restitution by pair of materials.
//!
//! A part of a machine and a primitive of the ground each have a material, named by a text. A pair
//! that is listed here has Coulomb's μ and Newton's e of its own, whichever of the two comes first;
//! every other pair has those of the step's options.
//!
//! A material may also have a friction of its own, which a machine's model states. It holds with
//! every other material whose pair is not listed; between two such materials the smaller one does.

use std::sync::Arc;

/// Longest name of a material, bytes.
pub const MAX_NAME: usize = 100;

/// Whether a text can name a material.
#[must_use]
pub fn is_name(text: &str) -> bool {
    !text.is_empty() && text.len() <= MAX_NAME
}

/// The law between two materials.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPair {
    /// Their names, in any order.
    pub materials: [String; 2],
    /// Coulomb's μ.
    pub friction_coefficient: f64,
    /// Newton's e, in [0, 1].
    pub restitution: f64,
}

impl MaterialPair {
    /// Whether these are its materials, in either order.
    #[must_use]
    pub fn is_of(&self, first: &str, second: &str) -> bool {
        let [a, b] = &self.materials;
        (a == first && b == second) || (a == second && b == first)
    }
}

/// A material with a friction of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnFriction {
    /// Name of the material.
    pub material: String,
    /// Coulomb's μ with materials that have none.
    pub friction_coefficient: f64,
}

/// The pairs that have a law of their own. Cheap to clone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Materials {
    /// `None` if there are none.
    pairs: Option<Arc<[MaterialPair]>>,
    /// Materials with a friction of their own, and Newton's e of their contacts.
    own: Option<(Arc<[OwnFriction]>, f64)>,
    is_inelastic: bool,
}

impl Materials {
    /// Laws of a list of pairs, of which the first entry for two materials counts.
    #[must_use]
    pub fn new(pairs: Vec<MaterialPair>) -> Self {
        Self {
            pairs: Some(pairs).filter(|pairs| !pairs.is_empty()).map(Arc::from),
            own: None,
            is_inelastic: false,
        }
    }

    /// Adds the materials of a machine that have a friction of their own; `restitution` is that of
    /// their contacts.
    #[must_use]
    pub fn with_own(mut self, own: &Arc<[OwnFriction]>, restitution: f64) -> Self {
        self.own = (!own.is_empty()).then(|| (Arc::clone(own), restitution));
        self
    }

    /// The laws with a restitution of zero between all materials.
    #[must_use]
    pub fn inelastic(&self) -> Self {
        Self {
            is_inelastic: true,
            ..self.clone()
        }
    }

    /// Whether there are none.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pairs.is_none() && self.own.is_none()
    }

    /// All pairs.
    #[must_use]
    pub fn pairs(&self) -> &[MaterialPair] {
        self.pairs.as_deref().unwrap_or_default()
    }

    /// Whether any of them bounces.
    #[must_use]
    pub fn is_elastic(&self) -> bool {
        !self.is_inelastic && self.pairs().iter().any(|pair| pair.restitution > 0.0)
    }

    /// μ and e between two materials, if they are listed.
    #[must_use]
    pub fn between(&self, first: &str, second: &str) -> Option<[f64; 2]> {
        let mut pairs = self.pairs().iter();
        let of_pair = pairs
            .find(|pair| pair.is_of(first, second))
            .map(|pair| [pair.friction_coefficient, pair.restitution]);
        let [mu, e] = of_pair.or_else(|| self.by_own(first, second))?;
        Some([mu, if self.is_inelastic { 0.0 } else { e }])
    }

    /// μ and e between two materials of which one has a friction of its own.
    fn by_own(&self, first: &str, second: &str) -> Option<[f64; 2]> {
        let (own, restitution) = self.own.as_ref()?;
        let of_either = own
            .iter()
            .filter(|own| own.material == first || own.material == second);
        let mu = of_either
            .map(|own| own.friction_coefficient)
            .reduce(f64::min)?;
        Some([mu, *restitution])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smaller_own_friction_holds_unless_the_pair_has_a_law() {
        let own = |material: &str, friction_coefficient| OwnFriction {
            material: material.to_owned(),
            friction_coefficient,
        };
        let own: Arc<[OwnFriction]> = Arc::new([own("tyre", 0.9), own("skid", 0.2)]);
        let listed = MaterialPair {
            materials: ["tyre".to_owned(), "rock".to_owned()],
            friction_coefficient: 1.5,
            restitution: 0.0,
        };
        let laws = Materials::new(vec![listed]).with_own(&own, 0.5);
        assert_eq!(laws.between("ground", "tyre"), Some([0.9, 0.5]));
        assert_eq!(laws.between("tyre", "skid"), Some([0.2, 0.5]));
        assert_eq!(laws.between("rock", "tyre"), Some([1.5, 0.0]));
        assert_eq!(laws.between("rock", "ground"), None);
        assert_eq!(laws.inelastic().between("ground", "tyre"), Some([0.9, 0.0]));
        assert!(!laws.is_empty() && laws.pairs().len() == 1);
    }

    #[test]
    fn the_order_of_two_materials_does_not_matter_and_others_have_no_law() {
        let pair = |a: &str, b: &str, mu| MaterialPair {
            materials: [a.to_owned(), b.to_owned()],
            friction_coefficient: mu,
            restitution: 0.25,
        };
        let laws = Materials::new(vec![pair("wheel", "rock", 0.5), pair("rock", "rock", 0.3)]);
        assert_eq!(laws.between("wheel", "rock"), Some([0.5, 0.25]));
        assert_eq!(laws.between("rock", "wheel"), Some([0.5, 0.25]));
        assert_eq!(laws.between("rock", "rock"), Some([0.3, 0.25]));
        assert_eq!(laws.between("wheel", "wheel"), None);
        assert!(laws.is_elastic() && !laws.inelastic().is_elastic());
        assert_eq!(laws.inelastic().between("rock", "wheel"), Some([0.5, 0.0]));
        assert!(Materials::new(Vec::new()).is_empty());
    }
}
