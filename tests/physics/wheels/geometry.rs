//! Contacts of wide wheels against points of their surface, taken by brute force.

use std::f64::consts::TAU;

use proptest::prelude::*;
use rover_core::contact::detection::{wheel_contact, wheel_gap};
use rover_core::geometry::query::{dispatch, roller_sphere};
use rover_core::geometry::{Plane, Roller, Sphere, SphereField, SupportMap, Terrain};
use rover_core::multibody::{Configuration, Kinematics};
use rover_core::nalgebra::{UnitQuaternion, Vector3};

use super::wheel_scenes::{lone, roller, shape, surface};
use crate::spheres::sphere_scenes::field;
use crate::surfaces::surface_scenes::{map, rough};

/// Radius, width and share of the rounding of a wheel.
fn sizes() -> impl Strategy<Value = [f64; 3]> {
    let share = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0];
    (0.1..0.4_f64, 0.01..0.3_f64, share)
        .prop_map(|(radius, width, share)| [radius, width.min(radius), share])
}

fn turns() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![
        prop::array::uniform3(-3.0..3.0),
        // upright, and lying on a side
        (-3.0..3.0).prop_map(|heading| [0.0, heading, 0.0]),
        (-3.0..3.0).prop_map(|heading| [0.25 * TAU, heading, 0.0]),
    ]
}

/// Depth of a point under a wheel's surface, m.
fn depth(roller: &Roller, x: &Vector3<f64>) -> f64 {
    let point = Sphere {
        centre: *x,
        radius: 0.0,
    };
    -roller_sphere::nearest_point(roller, &point, &Vector3::zeros()).gap
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn the_lowest_point_over_a_plane_is_lower_than_any_other(
        turn in turns(), size in sizes(), tilt in prop::array::uniform2(-0.5..0.5),
    ) {
        let plane = Plane::new([tilt[0], 1.0, tilt[1]], 0.2).unwrap();
        let wheel = roller([0.3, 0.1, -0.2], turn, size);
        let base = Vector3::new(1.0, 2.0, 3.0);
        let sampled = surface(&wheel, 180, 12).iter().map(|(x, _)| plane.distance(&(base + x))).fold(f64::INFINITY, f64::min);
        let low = dispatch::lowest_on_plane(&shape(&wheel), &plane, &base);
        // A chord between two of 180 points is 1.5e-4 radii off the rim.
        prop_assert!(low.gap <= sampled + 1e-12 && low.gap > sampled - 3e-3 * size[0]);
        let furthest = plane.distance(&(base + wheel.support(&-plane.normal())));
        prop_assert!(depth(&wheel, &low.point).abs() < 1e-12);
        prop_assert!((low.gap - furthest).abs() < 1e-12, "{} {furthest}", low.gap);
        let mut least = f64::INFINITY;
        let mut count = 0;
        dispatch::visit_on_plane(&shape(&wheel), &plane, &base, 10.0, |point| {
            assert!((point.gap - plane.distance(&(base + point.point))).abs() < 1e-12);
            // The other points are on the surface or in the wheel.
            assert!(depth(&wheel, &point.point) > -1e-12, "{point:?}");
            assert!((point.n - plane.normal()).norm() < 1e-15);
            let again = dispatch::point_on_plane(&shape(&wheel), &plane, &base, point.feature);
            assert_eq!(&again, point);
            least = least.min(point.gap);
            count += 1;
        });
        prop_assert!((least - low.gap).abs() < 1e-12);
        prop_assert_eq!(count, 3 * wheel.n_circles());
        let field = SphereField::new(&[], &[], Some(plane)).unwrap();
        prop_assert!((wheel_gap(&shape(&wheel), None, &base, &field) - low.gap).abs() < 1e-12);
    }

    #[test]
    fn no_point_is_nearer_to_a_sphere(
        turn in turns(), size in sizes(), place in prop::array::uniform3(-0.6..0.6),
    ) {
        let wheel = roller([0.3, 0.1, -0.2], turn, size);
        let base = Vector3::new(1.0, 2.0, 3.0);
        let sphere = Sphere { centre: base + wheel.core.centre + Vector3::from(place), radius: 0.05 };
        let near = dispatch::point_on_sphere(&shape(&wheel), &sphere, &base);
        prop_assert!((near.n.norm() - 1.0).abs() < 1e-12);
        prop_assert!(depth(&wheel, &near.point).abs() < 1e-12);
        let outward = near.point + base - sphere.centre;
        prop_assert!((outward - near.n * (near.gap + sphere.radius)).norm() < 1e-12);
        let samples = surface(&wheel, 180, 12);
        let sampled = samples.iter().map(|(x, _)| (base + x - sphere.centre).norm()).fold(f64::INFINITY, f64::min);
        let distance = near.gap + sphere.radius;
        prop_assert!(distance.abs() <= sampled + 1e-12, "{distance} {sampled}");
        prop_assert!(distance.abs() > sampled - 0.09 * size[0], "{distance} {sampled}");
        // Inside, every point of the surface faces away from the centre.
        let is_inside = samples.iter().all(|(x, n)| n.dot(&(base + x - sphere.centre)) > 0.0);
        prop_assert_eq!(distance < 0.0, is_inside);
    }

    /// Against a ridge the gap is the largest over all admissible normals of the distance along
    /// the normal, by the support map.
    #[test]
    fn the_gap_over_a_ridge_is_the_largest_over_its_normals(
        size in sizes(), turn in turns(), slopes in (0.1..1.2_f64, 0.1..1.2_f64),
        aside in -0.2..0.2, height in -0.02..0.1,
    ) {
        let roof = map(2, 4.0, |x, _| if x < 0.0 { slopes.0 * x } else { -slopes.1 * x });
        let normals = [slopes.0, -slopes.1].map(|slope| Vector3::new(-slope, 1.0, 0.0).normalize());
        let mut wheel = roller([aside, 0.0, 0.1], turn, size);
        let separation = |wheel: &Roller, tau: f64| {
            let n = (normals[0] * (1.0 - tau) + normals[1] * tau).normalize();
            n.dot(&wheel.support(&-n))
        };
        let largest = |wheel: &Roller| {
            // The function has one maximum: by golden section.
            let (mut a, mut b) = (0.0, 1.0);
            for _ in 0..80 {
                let (c, d) = (b - 0.618_034 * (b - a), a + 0.618_034 * (b - a));
                if separation(wheel, c) > separation(wheel, d) { b = d } else { a = c }
            }
            [0.0, 0.5 * (a + b), 1.0].map(|tau| separation(wheel, tau)).into_iter().fold(f64::NEG_INFINITY, f64::max)
        };
        wheel.core.centre.y += height + size[0] - largest(&wheel).min(0.0);
        let expected = largest(&wheel);
        prop_assume!(expected > -0.3 * size[0]);
        let gap = wheel_gap(&shape(&wheel), None, &Vector3::zeros(), &roof);
        prop_assert!((gap - expected).abs() < 1e-6, "{gap} {expected}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    /// The lowest point of all, wherever it is, is found: lifted free the gap is zero, and sunk in
    /// there is a contact that is about as deep.
    #[test]
    fn a_wide_wheel_always_has_the_contact_that_holds_it(
        field in rough(0.01..0.12), size in sizes(),
        x in -1.0..1.0, z in -1.0..1.0, heading in 0.0..TAU, lean in -0.5..0.5,
        depth in prop_oneof![Just(0.0), 1e-6..1e-3, 1e-3..1e-2],
    ) {
        let [dx, dz] = field.spacing();
        let size = size.map(|length| length.min(1.5 * dx));
        let mut wheel = roller([2.0 * x * dx, 0.0, 2.0 * z * dz], [lean, heading, 0.0], size);
        let over = |x: &Vector3<f64>| field.height(x.x, x.z).map_or(f64::NEG_INFINITY, |y| y - x.y);
        let points = surface(&wheel, 720, 24);
        let lift = points.iter().map(|(x, _)| over(x)).fold(f64::NEG_INFINITY, f64::max);
        wheel.core.centre.y += lift - depth;
        let gap = wheel_gap(&shape(&wheel), None, &Vector3::zeros(), &field);
        // Between two points a vertex may stand out by their distance times its slope.
        let coarse = 0.01 * dx;
        prop_assert!(gap < coarse, "{gap}");
        prop_assert!(gap > -depth - coarse, "{gap} {depth}");
        if depth > 1e-3 {
            prop_assert!(gap < -0.05 * depth + coarse, "{gap} {depth}");
        }
        wheel.core.centre.y += depth + coarse + 0.01;
        prop_assert!(wheel_gap(&shape(&wheel), None, &Vector3::zeros(), &field) > 0.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    /// Along any motion the gap changes by the normal velocity of the material point.
    #[test]
    fn the_gap_changes_by_the_normal_velocity(
        turn in prop::array::uniform3(-2.0..2.0), share in 0.0..1.0, height in 0.1..0.4,
        v in prop::collection::vec(-1.0..1.0, 6), ground in 0..3_usize,
    ) {
        let model = lone(0.1, 0.05 * share);
        let ground: Box<dyn Terrain> = match ground {
            0 => Box::new(Plane::new([0.2, 1.0, -0.1], 0.0).unwrap()),
            1 => Box::new(field(&[[0.02, -0.1, 0.03, 0.1]])),
            _ => Box::new(map(2, 4.0, |x, _| -0.7 * x.abs())),
        };
        let mut start = Configuration::zero(&model);
        start.position = Vector3::new(0.03, height, -0.02);
        start.attitude = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
        let contact_at = |q: &Configuration| wheel_contact(&model, &Kinematics::of(&model, q), &*ground, 0);
        let contact = contact_at(&start);
        let step = 1e-6;
        let moved = |h: f64| {
            let mut moved = start.clone();
            moved.set_moved(&model, &start, &v, h);
            contact_at(&moved)
        };
        let (before, after) = (moved(-step), moved(step));
        // Where the nearest point jumps the gap has a kink.
        prop_assume!((before.point - after.point).norm() < 1e-3);
        let rate = (after.gap - before.gap) / (2.0 * step);
        let [a, b, c, x, y, z] = v[..] else { unreachable!() };
        let velocity = Vector3::new(a, b, c) + Vector3::new(x, y, z).cross(&contact.point);
        let expected = contact.frame.n.dot(&velocity);
        prop_assert!((rate - expected).abs() < 1e-5, "{rate} for {expected}");
    }
}

#[test]
fn a_tread_over_a_summit_touches_at_the_summit() {
    let pyramid = map(2, 1.0, |x, z| if x == 0.0 && z == 0.0 { 0.5 } else { 0.0 });
    for along in [-0.06, 0.0, 0.03] {
        for gap in [0.01, 0.0, -1e-4] {
            let wheel = roller([0.0, 0.5 + 0.2 + gap, along], [0.0; 3], [0.2, 0.15, 0.0]);
            let own = wheel_gap(&shape(&wheel), None, &Vector3::zeros(), &pyramid);
            assert!((own - gap).abs() < 1e-12, "{along} {gap}: {own}");
        }
    }
}

#[test]
fn degenerate_places_of_a_sphere_have_normals() {
    for share in [0.0, 0.5, 1.0] {
        let wheel = roller([0.3, 0.1, -0.2], [0.4, 0.2, 0.1], [0.3, 0.1, share]);
        let (s, spoke) = (wheel.core.axle, wheel.core.spoke);
        for (out, along) in [
            (0.0, 0.0),
            (0.0, 0.05),
            (0.1, 0.0),
            (0.25, 0.0),
            (0.3, 0.05),
            (0.25, 0.05),
        ] {
            let centre = wheel.core.centre + spoke * out + s * along;
            let sphere = Sphere {
                centre,
                radius: 0.05,
            };
            let near = roller_sphere::nearest_point(&wheel, &sphere, &Vector3::zeros());
            assert!((near.n.norm() - 1.0).abs() < 1e-12, "{share} {out} {along}");
            assert!(near.point.iter().chain([&near.gap]).all(|x| x.is_finite()));
        }
    }
}

#[test]
fn the_gap_does_not_jump_as_a_wheel_leans_through_the_upright() {
    let grounds: [Box<dyn Terrain>; 3] = [
        Box::new(Plane::ground()),
        Box::new(map(20, 0.07, |_, _| 0.0)),
        Box::new(map(2, 1.0, |x, _| -0.3 * x.abs())),
    ];
    for share in [0.0, 0.3, 1.0] {
        for ground in &grounds {
            let gap = |lean: f64| {
                let wheel = roller([0.0, 0.3, 0.01], [lean, 0.0, 0.0], [0.3, 0.1, share]);
                wheel_gap(&shape(&wheel), None, &Vector3::zeros(), &**ground)
            };
            let leans = (-400..=400).map(|k| f64::from(k) * 1e-3);
            let gaps: Vec<f64> = leans.map(gap).collect();
            for pair in gaps.windows(2) {
                assert!((pair[1] - pair[0]).abs() < 0.3e-3, "{share} {pair:?}");
            }
            let upright = gap(0.0);
            assert!(upright.abs() < 1e-12, "{upright}");
            assert!((gap(1e-9) - upright).abs() < 1e-10);
        }
    }
}
