//! Rovers in a batch move bit for bit as each would alone, at any number of threads.

use std::sync::Arc;

use nalgebra::Vector3;
use rover_core::geometry::{Hit, Plane, Primitive, Ray, Rocks, Sphere, SphereField, Terrain};
use rover_core::integrator::{StepError, StepOptions};
use rover_core::multibody::{Configuration, Model};
use rover_core::nalgebra;
use rover_core::simulation::{
    Batch, BatchError, CommandError, ReadingLayout, ReadingRequest, ReadingScratch, RoverSimulation,
};

use crate::shared::{bits, flat, moving, resting};

const SCAN: [[f64; 2]; 3] = [[1.0, -0.5], [0.0, 0.0], [-0.3, 0.8]];
const TARGET: [f64; 2] = [3.0, -4.0];

/// A rover at rest on its own ground, a field of rocks for odd numbers.
fn rover(model: &Arc<Model>, i: usize) -> RoverSimulation {
    let field = Rocks {
        abundance: 0.1,
        area: [20.0, 20.0],
        seed: i as u64,
        ..Rocks::default()
    };
    let terrain: Arc<dyn Terrain> = if i % 2 == 1 {
        Arc::new(SphereField::rocks(&field).unwrap())
    } else {
        flat()
    };
    let options = StepOptions {
        friction_coefficient: 0.5 + 0.05 * i as f64,
        ..StepOptions::default()
    };
    resting(model.clone(), terrain, options, |q| q.position.y = 0.8)
}

fn rovers(n: usize) -> Vec<RoverSimulation> {
    let model = Arc::new(Model::rover());
    (0..n).map(|i| rover(&model, i)).collect()
}

fn torques(i: usize, period: usize) -> [f64; 6] {
    std::array::from_fn(|k| 30.0 * ((i + 3 * period + 5 * k) as f64).sin())
}

fn set_points(i: usize, period: usize) -> [f64; 6] {
    std::array::from_fn(|k| 0.3 * ((2 * i + period + k) as f64).cos())
}

fn batch(n: usize, threads: usize) -> Batch {
    let mut batch = Batch::new(rovers(n), SCAN.to_vec(), Some(threads)).unwrap();
    for (i, rover) in rovers(n).into_iter().enumerate() {
        batch.replace(i, rover, TARGET).unwrap();
    }
    batch
}

fn drive(batch: &mut Batch, periods: std::ops::Range<usize>, active: Option<&[bool]>) -> Vec<f64> {
    let n = batch.rovers().len();
    let mut rows = vec![0.0; n * batch.layout().size()];
    for period in periods {
        let tau: Vec<f64> = (0..n).flat_map(|i| torques(i, period)).collect();
        let delta: Vec<f64> = (0..n).flat_map(|i| set_points(i, period)).collect();
        batch.step(&tau, &delta, 5, active, &mut rows).unwrap();
    }
    rows
}

#[test]
fn a_batch_is_its_rovers_alone_for_any_number_of_threads() {
    let n = 7;
    let mut alone = Vec::new();
    for (i, mut rover) in rovers(n).into_iter().enumerate() {
        for period in 0..12 {
            rover.set_wheel_torques(&torques(i, period)).unwrap();
            rover.set_steering(&set_points(i, period)).unwrap();
            rover.step(5).unwrap();
        }
        let look = ReadingRequest {
            target: TARGET,
            scan: &SCAN,
        };
        let mut row = vec![0.0; ReadingLayout::new(rover.model(), SCAN.len()).size()];
        rover.read(&look, &mut ReadingScratch::default(), &mut row);
        alone.extend(row);
    }
    assert!(alone.iter().all(|x| x.is_finite()));
    for threads in [1, 2, 4, 16] {
        let mut batch = batch(n, threads);
        assert_eq!(batch.threads(), threads.min(n));
        let rows = drive(&mut batch, 0..12, None);
        assert_eq!(bits(&rows), bits(&alone), "{threads} threads");
        let mut read = vec![0.0; rows.len()];
        batch.read(&mut read);
        assert_eq!(bits(&read), bits(&rows));
    }
}

#[test]
fn a_rover_that_fails_fails_alone() {
    let n = 3;
    for threads in [1, 3] {
        let mut sound = batch(n, threads);
        let mut broken = batch(n, threads);
        let mut mad = rovers(n).remove(1);
        let mut v = vec![0.0; mad.model().nv()];
        v[3] = 1e30;
        let start = mad.q().clone();
        mad.set_state(start, v);
        broken.replace(1, mad, TARGET).unwrap();
        let width = sound.layout().size();
        let (a, b) = (
            drive(&mut sound, 0..3, None),
            drive(&mut broken, 0..3, None),
        );
        for i in [0, 2] {
            let own = i * width..(i + 1) * width;
            assert_eq!(bits(&a[own.clone()]), bits(&b[own]));
        }
        assert!(b.iter().all(|x| !x.is_nan()));
        let failed: Vec<bool> = broken.errors().iter().map(Option::is_some).collect();
        assert_eq!(failed, [false, true, false]);
        assert!(sound.errors().iter().all(Option::is_none));
    }
}

#[test]
fn rovers_that_are_not_active_keep_still() {
    let mut batch = batch(3, 2);
    drive(&mut batch, 0..2, None);
    let before = batch.rovers()[1].snapshot();
    let moving = batch.rovers()[2].time();
    drive(&mut batch, 2..4, Some(&[true, false, true]));
    assert_eq!(batch.rovers()[1].snapshot(), before);
    assert!(batch.rovers()[2].time() > moving);
}

#[test]
fn a_bad_command_moves_nobody() {
    let mut batch = batch(2, 2);
    let states = |batch: &Batch| -> Vec<_> {
        let rovers = batch.rovers().iter();
        rovers.map(RoverSimulation::snapshot).collect()
    };
    let before = states(&batch);
    let mut tau = vec![0.0; 12];
    tau[9] = f64::NAN;
    let mut rows = vec![0.0; 2 * batch.layout().size()];
    let error = batch
        .step(&tau, &[0.0; 12], 1, None, &mut rows)
        .unwrap_err();
    let BatchError::Command { index, error } = error else {
        panic!("{error}")
    };
    assert_eq!(index, 1);
    assert!(matches!(error, CommandError::NotFinite { index: 3, .. }));
    assert_eq!(before, states(&batch));
}

#[test]
fn a_call_that_is_told_to_stop_stops_after_a_whole_step() {
    let model = Arc::new(Model::rover());
    let (mut stopped, mut twin) = (rover(&model, 1), rover(&model, 1));
    let mut asked = 0;
    let report = stopped.step_while(100, &mut || {
        asked += 1;
        asked < 7
    });
    assert_eq!(report.unwrap().steps, 7);
    twin.step(7).unwrap();
    assert_eq!(stopped.snapshot(), twin.snapshot());
    assert_eq!(stopped.last_call(), twin.last_call());
}

#[test]
fn torques_stay_where_the_steering_is_refused() {
    let mut rover = rover(&Arc::new(Model::rover()), 0);
    let mut far = [0.1; 6];
    far[4] = 9.0;
    let refused = rover.set_commands(&[5.0; 6], &far);
    assert!(matches!(
        refused,
        Err(CommandError::BeyondLimit { index: 4, .. })
    ));
    assert_eq!(rover.wheel_torques(), [0.0; 6]);
    assert_eq!(rover.steering(), [0.0; 6]);
}

#[test]
fn batches_that_make_no_sense_are_refused() {
    assert!(matches!(
        Batch::new(vec![], vec![], None),
        Err(BatchError::Empty)
    ));
    let mut batch = batch(2, 1);
    let extra = rovers(1).remove(0);
    assert!(matches!(
        batch.replace(2, extra, TARGET),
        Err(BatchError::NoSuchRover { index: 2, len: 2 })
    ));
    let locked = [("front_axle".to_owned(), 0.0)];
    let welded = Arc::new(Model::rover().with_locked_joints(&locked).unwrap());
    assert!(matches!(
        batch.replace(0, rover(&welded, 0), TARGET),
        Err(BatchError::Differs {
            index: 0,
            expected: 21,
            actual: 20
        })
    ));
}

#[test]
fn a_reading_says_what_the_simulation_says() {
    let mut sim = rovers(2).remove(1);
    for period in 0..20 {
        sim.set_wheel_torques(&torques(0, period)).unwrap();
        sim.step(10).unwrap();
    }
    let layout = ReadingLayout::new(sim.model(), SCAN.len());
    let mut row = vec![0.0; layout.size()];
    sim.read(
        &ReadingRequest {
            target: TARGET,
            scan: &SCAN,
        },
        &mut ReadingScratch::default(),
        &mut row,
    );
    let of = |name: &str| {
        let (_, place) = layout.fields().iter().find(|(n, _)| *n == name).unwrap();
        &row[place.clone()]
    };
    let state = sim.state();
    let p = state.configuration.position;
    let R = state.configuration.attitude.to_rotation_matrix();
    assert!((of("pose")[0] - p.x).abs() < 1e-15);
    let ahead = R * nalgebra::Vector3::x();
    let heading = (-ahead.z).atan2(ahead.x);
    assert!((of("pose")[4] - heading).abs() < 1e-12);
    let to = nalgebra::Vector2::new(TARGET[0] - p.x, TARGET[1] - p.z);
    assert!((of("target")[2] - to.norm()).abs() < 1e-12);
    let along = to.x * heading.cos() - to.y * heading.sin();
    assert!((of("target")[0] - along).abs() < 1e-12);
    let lean = R.matrix()[(1, 1)];
    assert!((of("cos_tilt")[0] - lean).abs() < 1e-12);
    let body = R.inverse() * nalgebra::Vector3::new(state.v[0], state.v[1], state.v[2]);
    assert!((of("body_velocity")[0] - body.x).abs() < 1e-12);
    let under = sim.terrain().height(p.x, p.z).unwrap() - p.y;
    assert!((of("heights")[1] - under).abs() < 1e-12);
    assert!((of("slip_ratio")[0] - sim.slip_ratio()).abs() < 1e-15);
    for (gap, touches) in of("wheel_gaps").iter().zip(of("wheel_contacts")) {
        assert!((touches - f64::from(u8::from(*gap <= 1e-3))).abs() < 1e-15);
    }
}

#[test]
fn the_work_of_the_motors_is_the_energy_gained() {
    // Free flight without gravity: only the motors do work.
    let options = StepOptions {
        gravity: Vector3::zeros(),
        time_step: 1e-4,
        ..StepOptions::default()
    };
    let mut sim = resting(Model::rover(), flat(), options, |q| q.position.y = 100.0);
    sim.set_wheel_torques(&[20.0; 6]).unwrap();
    let before = sim.energy().kinetic;
    sim.step(500).unwrap();
    let gained = sim.energy().kinetic - before;
    let last = sim.last_call();
    assert!(gained > 10.0, "{gained}");
    // The steering joints' PD controllers dissipate less than a hundredth.
    assert!((last.positive_work / gained - 1.0).abs() < 0.01);
    assert!((last.work - last.positive_work).abs() <= 1e-12 * last.work);
}

/// A plane beside a ball far away that panics when asked for what lies beyond x = 0.5 m.
struct Mined(SphereField);

impl Mined {
    fn new() -> Self {
        let far = [[0.0, -50.0, 0.0]];
        Self(SphereField::new(&far, &[1.0], Some(Plane::ground())).unwrap())
    }

    fn check(x: f64) {
        assert!(x < 0.5, "a mine at x = 0.5");
    }
}

impl Terrain for Mined {
    fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        Self::check(centre.x);
        self.0.visit_near(centre, reach, visit);
    }

    fn visit_spheres(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Sphere),
    ) {
        Self::check(centre.x);
        self.0.visit_spheres(centre, reach, visit);
    }

    fn primitive(&self, id: u32) -> Primitive {
        self.0.primitive(id)
    }

    fn n_primitives(&self) -> u32 {
        self.0.n_primitives()
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        self.0.first_hit(ray, reach)
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        self.0.height(x, z)
    }

    fn ground(&self) -> Option<&Plane> {
        self.0.ground()
    }
}

/// A panic in one rover's step ended the process of all.
#[test]
fn a_rover_whose_step_panics_is_reported_and_the_others_of_its_batch_go_on() {
    let model = Arc::new(Model::rover());
    let ground: Arc<dyn Terrain> = Arc::new(Mined::new());
    let made = |i: usize| {
        let mut q = Configuration::zero(&model);
        (q.position.x, q.position.y) = (-0.9 - 0.3 * i as f64, 0.3);
        let mut v = vec![0.0; model.nv()];
        v[0] = 3.0;
        moving(model.clone(), ground.clone(), StepOptions::default(), q, v)
    };
    let n = 9;
    let mut alone: Vec<_> = (0..n).map(made).collect();
    let rovers: Vec<_> = (0..n).map(made).collect();
    for threads in [1, 3] {
        let mut batch = Batch::new(rovers.clone(), SCAN.to_vec(), Some(threads)).unwrap();
        let mut own = alone.clone();
        let mut rows = vec![0.0; n * batch.layout().size()];
        let (torques, set_points) = (vec![20.0; 6 * n], vec![0.0; 6 * n]);
        let mut has_failed = vec![false; n];
        for _ in 0..4 {
            batch
                .step(&torques, &set_points, 20, None, &mut rows)
                .unwrap();
            for (i, own) in own.iter_mut().enumerate() {
                own.set_wheel_torques(&[20.0; 6]).unwrap();
                let (taken, found) = (own.step(20), &batch.rovers()[i]);
                // How far ahead the ground is searched decides in which step it panics.
                has_failed[i] |= taken.is_err() || batch.errors()[i].is_some();
                if has_failed[i] {
                    assert!(found.v().iter().all(|v| v.is_finite()), "rover {i}");
                    continue;
                }
                assert_eq!(bits(own.v()), bits(found.v()), "rover {i}");
                assert_eq!(own.state(), found.state(), "rover {i}");
            }
        }
        let failed = |i: usize| match &batch.errors()[i] {
            Some(StepError::Internal { fault, .. }) => fault.message.contains("a mine"),
            _ => false,
        };
        assert!(failed(0) && !failed(n - 1));
    }
    // It goes on elsewhere.
    let first = &mut alone[0];
    assert!(first.step(200).is_err());
    let (q, v) = (made(n).q().clone(), vec![0.0; model.nv()]);
    first.set_state(q, v);
    assert!(first.step(20).unwrap().is_converged());
}
