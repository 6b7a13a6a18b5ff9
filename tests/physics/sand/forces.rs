//! The force of sand on one wheel: closed forms, continuity, points, scaling.

use rover_core::nalgebra::Vector3;
use rover_core::sand::patch::Relief;
use rover_core::sand::ruts::RutsNear;
use rover_core::sand::test_bed::rules_within;
use rover_core::sand::{
    Bed, Derivatives, GaussRules, Memory, OperatingPoint, Points, Resistive, RutMap, SandWheel,
    Soil, StressLaw, Sunk, TestBed, WheelPerformance, WheelPose, WheelTwist, Window, react,
    react_with,
};
use rover_core::scalar::Instructions;

use super::sand_scenes::{bekker_sand, dry_sand};
use crate::shared::near;

const WHEEL: SandWheel = SandWheel {
    radius: 0.1,
    width: 0.08,
    rounding: 0.005,
    grouser_height: 0.0,
    grousers: 0,
};

const LEVEL: Bed<'static> = Bed {
    place: Vector3::new(0.0, 0.0, 0.0),
    normal: Vector3::new(0.0, 1.0, 0.0),
    relief: None,
    highest: 0.0,
    gravity: 9.81,
};

/// 24 points along every arc, and these numbers across the drum and along the radius of a wall.
fn fine_rules(across: usize, radial: usize) -> GaussRules {
    GaussRules::new(Points {
        drum: [24, across],
        edge: 24,
        wall: [24, radial],
    })
}

fn bed_of(soil: Soil) -> TestBed {
    TestBed {
        wheel: WHEEL,
        rules: rules_within(&WHEEL, &soil, 0.01),
        soil,
    }
}

fn drive(rate: f64, slip_angle: f64, load: f64) -> OperatingPoint {
    OperatingPoint {
        speed: 0.1,
        rate,
        slip_angle,
        load,
        gravity: 9.81,
    }
}

fn stiffness(soil: &Soil) -> f64 {
    match &soil.law {
        StressLaw::Resistive(sand) => sand.stiffness(9.81),
        StressLaw::Bekker(_) => panic!("invariant: a resistive soil"),
    }
}

/// A wide drum with its axle level that is pressed straight down, at a small depth z: its bottom is
/// nearly a level plate, with `p = 1.03 ξ z` or so by the theory, over the chord `2 √(2 R z)`. The
/// mean depth over the chord is 2 z/3. The bottom is not quite level, which gives two per cent.
#[test]
fn a_wheel_pressed_down_bears_as_a_plate_does() {
    let soil = dry_sand();
    let wheel = SandWheel {
        rounding: 0.0,
        ..WHEEL
    };
    let pressed = Memory {
        shift: [0.0, -1e3, 0.0],
        turn: [0.0; 3],
    };
    let z = 1e-4;
    let force = TestBed {
        wheel,
        rules: fine_rules(4, 8),
        soil: soil.clone(),
    }
    .force(z, &pressed, &drive(0.0, 0.0, 1.0), Derivatives::Wrench);
    let area = 2.0 * (2.0_f64 * 0.1 * z).sqrt() * 0.08;
    let plate = 1.0308 * stiffness(&soil) * z * 2.0 / 3.0 * area;
    let found = force.wrench[1];
    assert!((found - plate).abs() < 0.03 * plate, "{found} {plate}");
}

/// Along random paths of pose and memory the force changes by no more than the change of the path
/// lets it.
#[test]
fn the_force_is_continuous_along_random_paths() {
    for soil in [dry_sand(), bekker_sand()] {
        let rules = rules_within(&WHEEL, &soil, 0.02);
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) * 2.0 - 1.0
        };
        for _ in 0..40 {
            let ends: [[f64; 9]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| random()));
            let force = |t: f64| {
                let x: [f64; 9] = std::array::from_fn(|k| ends[0][k] * (1.0 - t) + ends[1][k] * t);
                let pose = WheelPose {
                    centre: Vector3::new(0.0, 0.09 + 0.05 * x[0], 0.0),
                    axle: Vector3::new(0.3 * x[1], 0.3 * x[2], 1.0).normalize(),
                };
                let memory = Memory {
                    shift: [x[3], x[4], x[5]],
                    turn: [3.0 * x[6], 3.0 * x[7], 10.0 * x[8]],
                };
                let parts = (&WHEEL, &rules);
                react(parts, &soil, &LEVEL, &pose, &memory, Derivatives::Wrench).wrench
            };
            let size = (0..=20).map(|k| force(f64::from(k) / 20.0).norm());
            let size = size.fold(1.0, f64::max);
            // A jump would not become smaller with the step.
            let largest = |n: u32| {
                let jumps = (0..n).map(|k| {
                    let (a, b) = (f64::from(k) / f64::from(n), f64::from(k + 1) / f64::from(n));
                    (force(b) - force(a)).norm()
                });
                jumps.fold(0.0, f64::max)
            };
            let fine = largest(2000);
            assert!(fine < 0.05 * size, "{fine} of {size}");
        }
    }
}

/// A tilted wheel that slips and slides, with grousers and rounded edges.
fn askew() -> (SandWheel, WheelPose, Memory) {
    let wheel = SandWheel {
        grouser_height: 0.004,
        grousers: 20,
        ..WHEEL
    };
    let pose = WheelPose {
        centre: Vector3::new(0.3, 0.075, -0.2),
        axle: Vector3::new(0.2, 0.15, 1.0).normalize(),
    };
    let memory = Memory {
        shift: [0.5, -0.05, 0.2],
        turn: [0.4, -0.6, -7.0],
    };
    (wheel, pose, memory)
}

/// Size of a cell of ruts, m.
const CELL: f64 = 0.01;

/// A rut around a wheel, of a depth (m) that depends on the way from its centre along x, m.
fn rut(pose: &WheelPose, depth: impl Fn(f64) -> f64) -> RutMap {
    let (mut ruts, c) = (RutMap::new(1), pose.centre);
    let noted = |[x, _]: [f64; 2]| Some(depth(x - c.x).max(0.0));
    ruts.pass(0, [c.x, c.z], ([0.2; 2], CELL), noted);
    ruts.pass(0, [c.x + 1.0, c.z], ([0.0; 2], CELL), |_| None);
    ruts
}

/// The points of a wheel lie side by side in lanes. How many lanes a machine has does not matter.
///
/// On a bed with relief some points of a group are not in the sand. Their slopes counted where a
/// register held them together with points that are: drives over ripples parted on machines with
/// fewer lanes.
#[test]
fn the_force_has_the_same_bits_with_any_number_of_lanes() {
    let (wheel, pose, memory) = askew();
    let want = Derivatives::Slopes {
        by_memory: 0.7,
        by_pose: 0.002,
    };
    let ripples = |x: f64, z: f64| Some(0.01 * (40.0 * x).sin() * (70.0 * z).cos());
    let (ruts, window) = (rut(&pose, |_| 0.002), Window::default());
    let rippled = Bed {
        relief: Some(Relief {
            height: Some(&ripples),
            ruts: Some(RutsNear {
                map: &ruts,
                window: &window,
                cell: CELL,
            }),
        }),
        highest: 0.01,
        ..LEVEL
    };
    for (soil, bed) in [dry_sand(), bekker_sand()]
        .into_iter()
        .flat_map(|soil| [(soil.clone(), LEVEL), (soil, rippled)])
    {
        let rules = rules_within(&wheel, &soil, 0.01);
        let found = Instructions::all_of_this_machine()
            .into_iter()
            .map(|instructions| {
                let parts = (&wheel, &rules);
                react_with(instructions, parts, &soil, &bed, (&pose, &memory), want)
            });
        let found: Vec<_> = found.collect();
        assert!(found[0].wrench.norm() > 1.0, "{:?}", found[0]);
        assert!(found.iter().all(|other| other == &found[0]), "{found:?}");
    }
}

/// The derivatives by memory and by pose, which keep where the points lie and their normals, are
/// near those of finite differences. In a rut the depth also changes along it,
/// and the points move over the edge of what touches.
#[test]
fn the_slopes_of_a_wheel_are_its_derivatives() {
    let (wheel, pose, memory) = askew();
    // A rut that becomes deeper along its way.
    let (ruts, window) = (rut(&pose, |x| 0.02 + 0.2 * x), Window::default());
    let rutted = Bed {
        relief: Some(Relief {
            height: None,
            ruts: Some(RutsNear {
                map: &ruts,
                window: &window,
                cell: CELL,
            }),
        }),
        ..LEVEL
    };
    let cases = [
        (dry_sand(), LEVEL, [0.03, 0.03]),
        (dry_sand(), rutted, [0.1, 0.03]),
        (bekker_sand(), LEVEL, [0.03, 0.03]),
    ];
    for (soil, bed, [moved, left_out]) in cases {
        let rules = fine_rules(4, 8);
        let force = |pose: &WheelPose, memory: &Memory, by_memory: f64, by_pose: f64| {
            let want = Derivatives::Slopes { by_memory, by_pose };
            react((&wheel, &rules), &soil, &bed, pose, memory, want)
        };
        let by_memory = force(&pose, &memory, 1.0, 0.0).slope;
        let by_pose = force(&pose, &memory, 0.0, 1.0).slope;
        let step = 1e-5;
        for k in 0..6 {
            let shifted = |sign: f64| {
                let mut six = memory.six();
                six[k] += sign * step;
                let moved = Memory {
                    shift: [six[0], six[1], six[2]],
                    turn: [six[3], six[4], six[5]],
                };
                force(&pose, &moved, 0.0, 0.0).wrench
            };
            let change = (shifted(1.0) - shifted(-1.0)) / (2.0 * step);
            let error = (by_memory.column(k) - change).norm();
            assert!(error < moved * by_memory.norm(), "memory {k}: {error}");
        }
        for k in 0..3 {
            let sunk = |sign: f64| {
                let mut moved = pose;
                moved.centre[k] += sign * step;
                force(&moved, &memory, 0.0, 0.0).wrench
            };
            let change = (sunk(1.0) - sunk(-1.0)) / (2.0 * step);
            let error = (by_pose.column(k) - change).norm() / by_pose.norm();
            assert!(error < left_out, "pose {k} of {soil:?}: {error}");
        }
    }
}

/// The rules that are chosen for a wheel keep to the accuracy between the places where they were
/// chosen.
#[test]
fn the_number_of_points_follows_the_accuracy() {
    let soil = dry_sand();
    let (coarse, fine) = (
        rules_within(&WHEEL, &soil, 0.05),
        rules_within(&WHEEL, &soil, 0.005),
    );
    assert!(coarse.n_points() < fine.n_points());
    let exact = fine_rules(12, 24);
    let at = |rules: &GaussRules| {
        let bed = TestBed {
            wheel: WHEEL,
            soil: soil.clone(),
            rules: rules.clone(),
        };
        let drive = drive(1.3, 0.2, 1.0);
        let memory = Memory::steady(
            &WheelTwist {
                linear: Vector3::new(0.1, 0.0, 0.02),
                angular: Vector3::new(0.0, 0.0, -1.3),
            },
            0.1,
        );
        bed.force(0.023, &memory, &drive, Derivatives::Wrench)
            .wrench
    };
    let error = (at(&fine) - at(&exact)).norm() / at(&exact).norm();
    assert!(error < 0.02, "{error}");
}

/// Granular scaling (arXiv 2405.11001): with lengths L, masses M and gravity g as unit, forces are
/// M g and do not depend on speed. A wheel twice as large with eight times the load sinks twice as
/// deep and pulls eight times as much; at a sixth of the gravity with the same mass the sinkage is
/// the same and forces are a sixth.
#[test]
fn forces_follow_the_scaling_laws_of_grains() {
    let small = bed_of(dry_sand());
    let large = TestBed {
        wheel: SandWheel {
            radius: 0.2,
            width: 0.16,
            rounding: 0.01,
            ..WHEEL
        },
        ..small.clone()
    };
    for (slip, angle) in [(0.2, 0.0), (0.5, 0.4)] {
        let rate = 1.0 / (1.0 - slip);
        let one = small.steady(&drive(rate, angle, 20.0)).unwrap();
        let two = large.steady(&drive(0.5 * rate, angle, 160.0)).unwrap();
        let mut moon = drive(rate, angle, 20.0 / 6.0);
        moon.gravity /= 6.0;
        let moon = small.steady(&moon).unwrap();
        let mut fast = drive(3.0 * rate, angle, 20.0);
        fast.speed *= 3.0;
        let fast = small.steady(&fast).unwrap();
        for (found, length, force) in [(two, 2.0, 8.0), (moon, 1.0, 1.0 / 6.0), (fast, 1.0, 1.0)] {
            for (found, expected) in [
                (found.sinkage, length * one.sinkage),
                (found.drawbar, force * one.drawbar),
                (found.torque, force * length * one.torque),
            ] {
                near(found, expected, 1e-4 * expected.abs().max(1e-3));
            }
        }
    }
}

/// A run settles at what the steady solution says.
#[test]
fn a_run_ends_in_steady_motion() {
    for soil in [dry_sand(), bekker_sand()] {
        let bed = bed_of(soil);
        let drive = drive(1.25, 0.2, 20.0);
        let steady = bed.steady(&drive).unwrap();
        let mut state = Sunk::default();
        let mut last = WheelPerformance::default();
        for _ in 0..2000 {
            last = bed.advance(&mut state, &drive, 20.0 / 9.81, 0.005);
        }
        near(last.sinkage, steady.sinkage, 1e-5);
        near(last.drawbar, steady.drawbar, 1e-2);
    }
}

#[test]
fn wrong_numbers_are_refused_by_name() {
    let mut soil = dry_sand();
    soil.memory = 0.0;
    assert_eq!(soil.check().unwrap_err().field(), "memory");
    let StressLaw::Resistive(sand) = &dry_sand().law else {
        panic!("invariant: a resistive soil");
    };
    let wrong = Resistive {
        density: -1.0,
        ..sand.clone()
    };
    let soil = Soil {
        law: StressLaw::Resistive(wrong),
        ..dry_sand()
    };
    assert_eq!(soil.check().unwrap_err().field(), "density");
}
