//! Friction and restitution by pair of materials.
//!
//! A part of a machine and a primitive of the ground each have a material, named by a text. A pair
//! that is listed here has Coulomb's μ and Newton's e of its own, whichever of the two comes first;
//! every other pair has those of the step's options.

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

/// The pairs that have a law of their own. Cheap to clone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Materials {
    /// `None` if there are none.
    pairs: Option<Arc<[MaterialPair]>>,
    is_inelastic: bool,
}

impl Materials {
    /// Of a list, of which the first entry for two materials counts.
    #[must_use]
    pub fn new(pairs: Vec<MaterialPair>) -> Self {
        Self {
            pairs: Some(pairs).filter(|pairs| !pairs.is_empty()).map(Arc::from),
            is_inelastic: false,
        }
    }

    /// The same with a restitution of zero between all.
    #[must_use]
    pub fn inelastic(&self) -> Self {
        Self {
            pairs: self.pairs.clone(),
            is_inelastic: true,
        }
    }

    /// Whether there are none.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pairs.is_none()
    }

    /// All of them.
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
        let pair = pairs.find(|pair| pair.is_of(first, second))?;
        let restitution = if self.is_inelastic {
            0.0
        } else {
            pair.restitution
        };
        Some([pair.friction_coefficient, restitution])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
