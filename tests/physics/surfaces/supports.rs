//! Every shape rests on everything that can bear it: a table of shapes by supports, as meshes and
//! as maps.

use std::sync::Arc;

use rover_core::geometry::{Terrain, TriangleMesh};
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::nalgebra::{UnitQuaternion, Vector3};

use super::surface_scenes::map;
use crate::shared::{body, largest, prism, resting};

/// Height of all supports, m.
const TOP: f64 = 0.5;

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// Adds the box between two corners.
fn block(mesh: &mut (Vec<[f64; 3]>, Vec<[usize; 3]>), low: [f64; 3], high: [f64; 3]) {
    let first = mesh.0.len();
    let corner = |k: usize| [0, 1, 2].map(|a| if k >> a & 1 == 1 { high[a] } else { low[a] });
    mesh.0.extend((0..8).map(corner));
    let sides = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    for [a, b, c, d] in sides.map(|side| side.map(|k| first + k)) {
        mesh.1.extend([[a, b, c], [a, c, d]]);
    }
}

/// Adds a needle with a square foot.
fn spike(mesh: &mut (Vec<[f64; 3]>, Vec<[usize; 3]>), [x, z]: [f64; 2]) {
    let first = mesh.0.len();
    let foot = [[-0.02, -0.02], [-0.02, 0.02], [0.02, 0.02], [0.02, -0.02]];
    mesh.0.extend(foot.map(|[dx, dz]| [x + dx, 0.0, z + dz]));
    mesh.0.push([x, TOP, z]);
    let side = |k: usize| [first + k, first + (k + 1) % 4, first + 4];
    mesh.1.extend((0..4).map(side));
    mesh.1
        .extend([[first + 2, first + 1, first], [first + 3, first + 2, first]]);
}

/// Where a support is high, as blocks from (x, z) to (x, z).
#[derive(Clone, Copy, Debug, PartialEq)]
enum Support {
    Edge,
    Walls,
    ShortWalls,
    Slot,
    Corner,
    Spikes,
}

impl Support {
    fn blocks(self) -> Vec<[[f64; 2]; 2]> {
        match self {
            Self::Edge => vec![[[-1.0, -1.0], [0.0, 1.0]]],
            Self::Walls => [-0.2, 0.1].map(|x| [[x, -1.0], [x + 0.1, 1.0]]).into(),
            Self::ShortWalls => [-0.2, 0.1].map(|x| [[x, -0.05], [x + 0.1, 0.05]]).into(),
            Self::Slot => vec![[[-1.0, -1.0], [-0.1, 1.0]], [[0.1, -1.0], [1.0, 1.0]]],
            Self::Corner => vec![[[-1.0, -1.0], [0.0, 0.0]]],
            Self::Spikes => {
                let of = |x: f64| [-0.1, 0.1].map(|z| [[x, z]; 2]);
                [-0.1, 0.1].map(of).concat()
            }
        }
    }

    fn mesh(self) -> TriangleMesh {
        let mut mesh = (Vec::new(), Vec::new());
        for [low, high] in self.blocks() {
            if self == Self::Spikes {
                spike(&mut mesh, low);
            } else {
                block(&mut mesh, [low[0], 0.0, low[1]], [high[0], TOP, high[1]]);
            }
        }
        TriangleMesh::new(&mesh.0, &mesh.1).unwrap()
    }

    /// As a map with a cell of 0.05 m between what is high and what is low.
    fn map(self) -> Arc<dyn Terrain> {
        let blocks = self.blocks();
        let is_in = |x: f64, z: f64, [low, high]: &[[f64; 2]; 2]| {
            let within = |x: f64, low: f64, high: f64| x > low - 1e-6 && x < high + 1e-6;
            within(x, low[0], high[0]) && within(z, low[1], high[1])
        };
        Arc::new(map(40, 0.05, |x, z| {
            if blocks.iter().any(|block| is_in(x, z, block)) {
                TOP
            } else {
                0.0
            }
        }))
    }

    /// Where a flat body of 0.2 m to either side is borne, its mass centre over the support.
    fn places(self) -> &'static [[f64; 2]] {
        match self {
            // Half over the edge, by almost as much, and turned away from it by a wall's width.
            Self::Edge => &[[-0.001, 0.0], [-0.05, 0.0131], [-0.1, 0.02]],
            Self::Corner => &[[-0.002, -0.001], [-0.04, -0.03]],
            Self::Walls | Self::ShortWalls | Self::Slot | Self::Spikes => {
                &[[0.0, 0.0], [0.021, 0.013]]
            }
        }
    }
}

const SUPPORTS: [Support; 6] = [
    Support::Edge,
    Support::Walls,
    Support::ShortWalls,
    Support::Slot,
    Support::Corner,
    Support::Spikes,
];

/// A body of 2 kg of one shape, or one wheel.
fn machine(shape: &str) -> Arc<Model> {
    Arc::new(if shape.starts_with("radius") {
        let text = format!(
            "shape = {{ kind = 'cylinder', radius = 0.2, height = 0.1 }}\n[[wheels]]\nname = 'W'\n\
             solid = 'body'\naxle = [0.0, 1.0, 0.0]\ntorque_limit = 1.0\ndrive_sign = -1.0\n{shape}"
        );
        body(2.0, &text)
    } else {
        body(2.0, &format!("shapes = [{{ {shape}, collides = true }}]"))
    })
}

const BOX: &str = "kind = 'box', size = [0.4, 0.1, 0.4]";
const DRUM: &str = "kind = 'cylinder', radius = 0.2, height = 0.1";
const ROD: &str = "kind = 'cylinder', radius = 0.05, height = 0.4";
const CAPSULE: &str = "kind = 'capsule', radius = 0.05, height = 0.3";
const BALL: &str = "kind = 'sphere', radius = 0.2";
const EGG: &str = "kind = 'ellipsoid', radii = [0.2, 0.2, 0.3]";

/// Places a body and lets it rest. Says what is wrong, if anything is.
fn unrest(
    model: &Arc<Model>,
    ground: &Arc<dyn Terrain>,
    place: Vector3<f64>,
    turn: UnitQuaternion<f64>,
    (lifted, may_roll): (f64, bool),
) -> Option<String> {
    let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, 0.2, -0.5) * lifted);
    let options = StepOptions::default();
    let mut simulation = resting(model.clone(), ground.clone(), options, |q| {
        q.position = place + Vector3::y() * lifted;
        q.attitude = tilt * turn;
    });
    simulation.step(400).unwrap();
    let before = simulation.q().clone();
    let mut fastest = 0.0_f64;
    for _ in 0..40 {
        simulation.step(1).unwrap();
        fastest = largest(simulation.v()).max(fastest);
    }
    let after = simulation.q();
    let (drift, aside) = (
        (after.position - before.position).norm(),
        after.position - place,
    );
    let sunk = aside.y.abs() > 3e-4 + 0.2 * lifted;
    // What a wheel yields by settles within seconds, and what may roll keeps what rounding gave it.
    let still = match (model.has_compliance(), may_roll) {
        (true, _) => 1e-7,
        (false, true) => 1e-8,
        (false, false) => 1e-9,
    };
    (fastest > still || drift > still || sunk || aside.norm() > 1e-3 + 2.0 * lifted).then(|| {
        let n = simulation.contacts().len();
        format!("{fastest:.1e} m/s, {aside:?} m off, {n} contacts")
    })
}

/// A box half over a block's edge never came to rest: only its corners over the block bore it, and
/// the place where its sides cross the edge did so when rounding allowed. Drums that stood or lay
/// on two walls fell between them, and hulls trembled.
#[test]
fn a_flat_shape_rests_half_over_an_edge_and_on_two_walls() {
    flat_shapes_rest(&[Support::Edge, Support::Walls], 1, 4);
}

/// A corner on a drum's lower face to the bit pushed it aside, and it fell; a rim tangent to the
/// far sides of two walls was in them by its whole width.
#[test]
fn a_drum_rests_where_a_corner_or_the_far_side_of_a_wall_just_touches_it() {
    let (model, turn) = (machine(DRUM), UnitQuaternion::identity());
    for (support, x, z) in [
        (Support::Corner, -0.002, -0.001),
        (Support::ShortWalls, 0.0, 0.0),
    ] {
        for ground in [Arc::new(support.mesh()) as Arc<dyn Terrain>, support.map()] {
            let place = Vector3::new(x, TOP + 0.05, z);
            assert_eq!(
                unrest(&model, &ground, place, turn, (0.0, false)),
                None,
                "{support:?}"
            );
        }
    }
}

/// Ignored because it takes minutes: `make test-all` runs it. The first test, which always runs,
/// has the supports where bodies fell through.
#[test]
#[ignore = "tests/physics/surfaces/supports.rs::a_flat_shape_rests_half_over_an_edge_and_on_two_walls"]
fn every_flat_shape_rests_on_an_edge_two_walls_a_slot_a_corner_and_spikes() {
    flat_shapes_rest(&SUPPORTS, usize::MAX, 1);
}

/// On the first so many places of each support; every so many-th case.
fn flat_shapes_rest(supports: &[Support], n_places: usize, every: usize) {
    // A slab with six sides of 0.2 m and a height of 0.1 m.
    let slab = prism(0.2, 0.05);
    // Turned by rotation vectors; half the height of the body as it lies.
    let bodies: [(&str, [f64; 3], f64); 9] = [
        (BOX, [0.0; 3], 0.05),
        (BOX, [0.0, 0.3, 0.0], 0.05),
        (&slab, [0.0; 3], 0.05),
        (&slab, [0.0, 0.2, 0.0], 0.05),
        (DRUM, [0.0; 3], 0.05),
        (ROD, [0.0, 0.0, QUARTER], 0.05),
        (CAPSULE, [0.0, 0.0, QUARTER], 0.05),
        ("radius = 0.2", [0.0; 3], 0.0),
        ("radius = 0.2\nwidth = 0.1\nrounding = 0.02", [0.0; 3], 0.05),
    ];
    let mut wrong = Vec::new();
    let mut case = 0;
    for &support in supports {
        let grounds = [Arc::new(support.mesh()) as Arc<dyn Terrain>, support.map()];
        for (shape, turn, half) in bodies {
            let is_round = shape == ROD || shape == CAPSULE;
            // What can roll off or tip over a corner or a spike does.
            if is_round && matches!(support, Support::Corner | Support::Spikes) {
                continue;
            }
            let model = machine(shape);
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
            for (kind, ground) in ["mesh", "map"].iter().zip(&grounds) {
                for &[x, z] in support.places().iter().take(n_places) {
                    for lifted in [0.0, 1e-3] {
                        // Nothing brakes what rolls, what is all but half over tips over, and what
                        // a wheel that yields is dropped by dies away slowly.
                        let is_close = (-0.01..0.0).contains(&x);
                        let yields = model.has_compliance();
                        if (is_round || is_close || yields) && lifted > 0.0 {
                            continue;
                        }
                        case += 1;
                        if case % every > 0 {
                            continue;
                        }
                        let place = Vector3::new(x, TOP + half, z);
                        if let Some(what) = unrest(&model, ground, place, turn, (lifted, is_round))
                        {
                            let at = format!("{shape} {turn:?} {support:?} {kind} {x} {lifted}");
                            wrong.push(format!("{at}: {what}"));
                        }
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} {wrong:#?}", wrong.len());
}

/// A straight line of a body along an edge touches it at both ends of what they share.
#[test]
fn what_lies_along_two_edges_rests_in_the_slot_between_them() {
    let in_slot = |radius: f64| (radius * radius - 0.01).sqrt();
    let along = [QUARTER, 0.0, 0.0];
    let diamond = [0.0, 0.0, 0.5 * QUARTER];
    let bodies: [(&str, [f64; 3], f64); 6] = [
        (
            "kind = 'cylinder', radius = 0.15, height = 0.4",
            along,
            in_slot(0.15),
        ),
        (
            "kind = 'capsule', radius = 0.15, height = 0.2",
            along,
            in_slot(0.15),
        ),
        (
            "kind = 'box', size = [0.3, 0.3, 0.4]",
            diamond,
            0.15 * 2.0_f64.sqrt() - 0.1,
        ),
        (BALL, [0.0; 3], in_slot(0.2)),
        (EGG, [0.0; 3], in_slot(0.2)),
        (
            "kind = 'hull', points = [[0.3, 0.1, 0.2], [-0.3, 0.1, 0.2], [0.0, -0.2, 0.2], [0.3, 0.1, -0.2], [-0.3, 0.1, -0.2], [0.0, -0.2, -0.2]]",
            [0.0; 3],
            0.1,
        ),
    ];
    let mut wrong = Vec::new();
    // The slot is longer than the bodies, or shorter, so that its own ends bear them.
    for (support, [low, high]) in [(Support::Slot, [-1.0, 1.0]), (Support::Slot, [-0.1, 0.15])] {
        let mut mesh = (Vec::new(), Vec::new());
        block(&mut mesh, [-1.0, 0.0, low], [-0.1, TOP, high]);
        block(&mut mesh, [0.1, 0.0, low], [1.0, TOP, high]);
        let mesh: Arc<dyn Terrain> = Arc::new(TriangleMesh::new(&mesh.0, &mesh.1).unwrap());
        let mut grounds = vec![mesh];
        if low < -0.5 {
            grounds.push(support.map());
        }
        for (shape, turn, height) in bodies {
            let model = machine(shape);
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
            for (k, ground) in grounds.iter().enumerate() {
                for lifted in [0.0, 1e-3] {
                    // What rolls needs to be placed without a tilt; one slot is enough for tilts.
                    let rolls = shape == BALL || shape == EGG;
                    if (rolls || low > -0.5) && lifted > 0.0 {
                        continue;
                    }
                    let place = Vector3::new(0.0, TOP + height, 0.0);
                    if let Some(what) = unrest(&model, ground, place, turn, (lifted, false)) {
                        wrong.push(format!("{shape} {low} {k} {lifted}: {what}"));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} {wrong:#?}", wrong.len());
}
