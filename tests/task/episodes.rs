//! Episodes in a batch go on bit for bit as each would alone, at any number of threads.

use std::sync::Arc;

use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::simulation::{ReadingScratch, RoverScene, RoverSimulation};
use rover_task::draw::domain::DomainDistribution;
use rover_task::draw::rocks::RockDistribution;
use rover_task::draw::scene::{FixedDraws, SceneDistribution};
use rover_task::draw::start::StartDistribution;
use rover_task::draw::{Order, Pcg64};
use rover_task::episode::running::Period;
use rover_task::episode::{
    Beginning, Ending, EpisodeBatch, EpisodeDistribution, EpisodeError, Rules, Settings,
    SharedRover, noise,
};

const SCAN: [[f64; 2]; 3] = [[1.0, -0.5], [0.0, 0.0], [-0.3, 0.8]];
const SIZE: usize = 91 + SCAN.len();

fn settings() -> Settings {
    Settings {
        substeps: 5,
        dt: 0.025,
        torque_limits: vec![150.0; 6],
        max_steering: 0.5,
        goal_tolerance: 0.5,
        cos_max_tilt: 0.5,
        stuck_time: 2.0,
        weights: [1.0, -0.05, -5e-5, -0.1, -0.1, -0.02, -0.02, 10.0, -10.0],
        gravity: 9.81,
        noise: 0.01,
        scan: SCAN.to_vec(),
        goals: 1,
        battery: None,
        free_distance: None,
        field_margin: None,
    }
}

fn model() -> Arc<Model> {
    Arc::new(Model::rover())
}

fn rules(model: &Arc<Model>) -> Arc<Rules> {
    Arc::new(Rules::new(model.clone(), settings()).unwrap())
}

/// Rocks for odd numbers, a plane for even ones.
fn distribution(model: &Arc<Model>, i: usize) -> EpisodeDistribution {
    let rocks = RockDistribution {
        difficulty: [0.2, 0.9],
        abundance: None,
        max_radius: None,
    };
    EpisodeDistribution {
        scenes: SceneDistribution {
            rover: RoverScene::new(model.clone(), Arc::new(Plane::ground())),
            options: StepOptions::default(),
            ground: rover_task::draw::GroundDistribution::Tilted,
            rocks: (i % 2 == 1).then_some(rocks),
            slope_by_difficulty: false,
            start: StartDistribution {
                slope: [0.0, 0.1],
                uphill: [-3.0, 3.0],
                heading: [-3.0, 3.0],
                goal_distance: [3.0, 5.0],
                goal_bearing: [-1.0, 1.0],
                further: 0,
                turn: [0.0, 0.0],
            },
            domain: DomainDistribution {
                mass_scale: [1.0, 1.0],
                friction: [0.5, 0.8],
                actuator_gain: [0.8, 1.2],
                gravity_scale: [1.0, 1.0],
            },
            goal_tolerance: 0.5,
        },
        rules: rules(model),
        trunk_load_limit: 900.0,
    }
}

fn begin(model: &Arc<Model>, i: usize) -> Beginning {
    let order = Order {
        random: Pcg64::seeded(&[u32::try_from(i).unwrap()]),
        difficulty: None,
        fixed: &FixedDraws::default(),
    };
    let drawn = distribution(model, i).draw(&[order], 100, None, &mut || true);
    drawn.unwrap().unwrap().remove(0)
}

/// A rover as the beginning of an episode places it.
fn rover(beginning: &Beginning) -> RoverSimulation {
    let placement = beginning.scene.placement.clone();
    let scene = placement.scene;
    let mut rover = RoverSimulation::new(scene.model, scene.terrain, placement.options).unwrap();
    rover.set_state(placement.configuration, placement.v);
    rover
}

fn action(i: usize, period: usize) -> [f64; 12] {
    std::array::from_fn(|k| 0.3 * ((3 * i + 5 * period + k) as f64).sin())
}

fn bits(observations: &[f32]) -> Vec<u32> {
    observations.iter().map(|x| x.to_bits()).collect()
}

/// Rover `i` for some periods, alone: its observations one after another, and its reward at last.
fn alone(model: &Arc<Model>, i: usize, periods: usize) -> (Vec<u32>, u64) {
    let rules = rules(model);
    let begun = begin(model, i);
    let mut rover = rover(&begun);
    let (mut episode, mut generator) = (begun.episode, begun.random);
    let mut scratch = ReadingScratch::default();
    let mut reading = vec![0.0; rules.places().size];
    let (mut heights, mut normals) = ([0.0; SCAN.len()], [0.0; SIZE]);
    let mut seen = Vec::new();
    for period in 0..periods {
        let action = action(i, period);
        episode
            .command(&mut rover, &action, &mut [0.0; 12])
            .unwrap();
        rover.step(5).unwrap();
        rover.read_state(episode.goal(), &mut scratch, &mut reading);
        rover.read_heights(&SCAN, &mut heights);
        noise::draw(&mut generator, &mut normals);
        let period = Period {
            action: &action,
            heights: Some(&heights),
            normals: Some(&normals),
            has_failed: false,
        };
        let mut observation = [0.0; SIZE];
        episode.advance(&mut reading, &period, &mut observation);
        seen.extend(bits(&observation));
    }
    (seen, episode.outcome().reward.to_bits())
}

fn batch(model: &Arc<Model>, n: usize, threads: usize) -> EpisodeBatch {
    let first = rover(&begin(model, 0));
    let mut batch = EpisodeBatch::new(rules(model), &first, n, Some(8), Some(threads)).unwrap();
    for i in 0..n {
        batch.begin(i, begin(model, i)).unwrap();
    }
    batch
}

#[test]
fn a_reading_that_float32_cannot_hold_ends_the_episode() {
    let model = model();
    let begun = begin(&model, 0);
    let rover = rover(&begun);
    let mut reading = vec![0.0; rules(&model).places().size];
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let mut episode = begun.episode.clone();
        rover.read_state(episode.goal(), &mut ReadingScratch::default(), &mut reading);
        reading[model.nv() + 6 + model.n_joints()] = value; // the first wheel's gap
        let period = Period {
            action: &action(0, 0),
            heights: None,
            normals: Some(&[0.0; SIZE]),
            has_failed: false,
        };
        let (last, mut observation) = (episode.observation().to_vec(), [0.0; SIZE]);
        episode.advance(&mut reading, &period, &mut observation);
        let outcome = episode.outcome();
        assert_eq!(outcome.ending, Ending::StepFailed);
        assert_eq!(outcome.reward.to_bits(), outcome.terms[8].to_bits());
        assert_eq!(bits(&observation), bits(&last));
    }
}

fn times(batch: &EpisodeBatch) -> Vec<f64> {
    let time = |rover: &SharedRover| rover.lock().unwrap().time();
    batch.rovers().iter().map(time).collect()
}

fn actions(n: usize, period: usize) -> Vec<f64> {
    (0..n).flat_map(|i| action(i, period)).collect()
}

#[test]
fn a_batch_is_its_episodes_alone_for_any_number_of_threads() {
    let (model, n, periods) = (model(), 5, 8);
    let expected: Vec<_> = (0..n).map(|i| alone(&model, i, periods)).collect();
    for threads in [1, 2, 3, 9] {
        let mut batch = batch(&model, n, threads);
        assert_eq!(batch.threads(), threads.min(n));
        let mut rows = vec![0.0; n * SIZE];
        for period in 0..periods {
            let actions = actions(n, period);
            batch
                .step_while(&actions, None, true, &mut rows, &mut || true)
                .unwrap();
            for (i, row) in rows.chunks_exact(SIZE).enumerate() {
                let seen = period * SIZE..(period + 1) * SIZE;
                assert_eq!(bits(row), expected[i].0[seen], "rover {i}");
                assert_eq!(batch.is_truncated(i).unwrap(), period == 7);
            }
        }
        for (i, (_, reward)) in expected.iter().enumerate() {
            let outcome = batch.episode(i).unwrap().outcome();
            assert_eq!(outcome.reward.to_bits(), *reward);
            assert_eq!(outcome.ending, Ending::None);
        }
    }
}

#[test]
fn what_is_refused_moves_no_rover() {
    let (model, n) = (model(), 3);
    let mut batch = batch(&model, n, 2);
    let mut rows = vec![0.0; n * SIZE];
    let good = actions(n, 0);
    let mut bad = good.clone();
    bad[17] = f64::NAN;
    let mut step = |actions: &[f64], active: Option<&[bool]>| {
        batch.step_while(actions, active, true, &mut rows, &mut || true)
    };
    let refused = step(&bad, None).unwrap_err();
    assert!(refused.to_string().starts_with("action[1, 5]:"));
    let refused = step(&good[1..], None).unwrap_err();
    assert!(matches!(
        refused,
        EpisodeError::Length {
            field: "action",
            ..
        }
    ));
    let refused = step(&good, Some(&[true])).unwrap_err();
    assert!(matches!(
        refused,
        EpisodeError::Length {
            field: "active",
            ..
        }
    ));
    assert!(times(&batch).iter().all(|&time| time == 0.0));
    let (rules, first) = (rules(&model), rover(&begin(&model, 0)));
    let mut unbegun = EpisodeBatch::new(rules, &first, n, None, Some(1)).unwrap();
    let refused = unbegun.step_while(&good, None, true, &mut rows, &mut || true);
    assert_eq!(refused, Err(EpisodeError::NotBegun { index: 0 }));
}

#[test]
fn a_rover_that_is_stopped_stops_after_a_whole_step() {
    let (model, n) = (model(), 4);
    for threads in [1, 2] {
        let mut batch = batch(&model, n, threads);
        let mut rows = vec![0.0; n * SIZE];
        batch
            .step_while(&actions(n, 0), None, true, &mut rows, &mut || false)
            .unwrap();
        let first = batch.rovers()[0].lock().unwrap().options().time_step;
        assert!(times(&batch).iter().all(|&time| time / first < 5.5));
        assert!(times(&batch).contains(&0.0));
    }
}

#[test]
fn steering_beyond_the_models_limit_is_refused() {
    let model = model();
    let wide = Settings {
        max_steering: 10.0,
        ..settings()
    };
    let rules = Rules::new(model.clone(), wide).unwrap();
    let refused = rules.check_model(&model).unwrap_err();
    assert!(matches!(
        refused,
        EpisodeError::OutOfRange {
            field: "max_steering",
            ..
        }
    ));
}
