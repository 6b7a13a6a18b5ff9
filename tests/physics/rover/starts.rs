//! Starts: where an episode begins, the rover stands and stays.

use std::sync::Arc;

use rover_core::contact::detection::wheel_contacts;
use rover_core::contact::placement::{PlacementError, resting_on};
use rover_core::geometry::Terrain;
use rover_core::multibody::{Kinematics, Model, coordinates};

use crate::shared::{in_public, largest};
use crate::surfaces::surface_scenes::map;

#[test]
fn a_rover_on_hills_stands_on_all_six_wheels_and_stays() {
    let hills = |x: f64, z: f64| {
        let (x, z) = (x + 4.0, z + 4.0);
        0.12 * (1.7 * x).sin() * (1.3 * z).cos() + 0.1 * x
    };
    let field: Arc<dyn Terrain> = Arc::new(map(80, 0.1, hills));
    let model = Arc::new(Model::rover());
    for (position, heading) in [([0.0, 0.0], 0.0), ([1.2, -0.7], 1.0), ([-1.0, 1.5], -2.5)] {
        let q = resting_on(&model, &*field, position, heading).unwrap();
        assert!((q[0] - position[0]).abs() < 1e-15 && (q[2] - position[1]).abs() < 1e-15);
        let configuration = coordinates::from_public(&model, &q).unwrap();
        let kinematics = Kinematics::of(&model, &configuration);
        let gaps = wheel_contacts(&model, &kinematics, &*field);
        for contact in &gaps {
            assert!((-1e-8..1e-6).contains(&contact.gap), "{}", contact.gap);
        }
        let mut rover = in_public(Arc::clone(&model), Arc::clone(&field), &q);
        rover.step(1).unwrap();
        let speed = largest(rover.v());
        assert!(speed < 0.2, "{speed}");
    }
    let off = resting_on(&model, &*field, [3.9, 0.0], 0.0).unwrap_err();
    assert!(matches!(off, PlacementError::NoGround { .. }), "{off}");
}
