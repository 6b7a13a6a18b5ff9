//! Balls on walls that move, in vessels, and with cohesion: closed forms.

use std::sync::Arc;

use rover_core::geometry::{Drum, Floor, Silo, Support};
use rover_core::nalgebra::Vector3;
use rover_core::simulation::GrainSimulation;
use rover_core::system::grains::{Cohesion, GrainScene, Wall};

use super::grain_scenes::{G, MASS, RADIUS, alike, awake, between, exact, rough};
use super::shared::{bits, near};

const MU: f64 = 0.3;

fn scene(
    n: usize,
    walls: Vec<Wall<3>>,
    ground: Option<Arc<dyn Support<3>>>,
    cohesion: f64,
) -> GrainScene<3> {
    let attraction = Cohesion::new(cohesion, None, RADIUS).expect("a force");
    GrainScene {
        ground,
        ..between(walls, alike(n).with_cohesion(attraction), rough(MU))
    }
}

fn simulation(scene: GrainScene<3>, q: &[f64]) -> GrainSimulation<3> {
    let options = exact(&scene, 1e-9);
    awake(scene, options, q)
}

fn moving_floor(velocity: Vector3<f64>) -> Wall<3> {
    Wall::floor(0.0).moving(velocity).expect("a velocity")
}

#[test]
fn a_belt_leaves_a_ball_two_sevenths_of_its_speed() {
    let belt = moving_floor(Vector3::new(1.4, 0.0, -0.7));
    let mut ball = simulation(scene(1, vec![belt], None, 0.0), &[0.0, RADIUS, 0.0]);
    ball.step(100).expect("steps");
    let early = ball.v()[0].hypot(ball.v()[2]);
    assert!((early - MU * G * 0.1).abs() < 1e-6, "dragged by friction");
    ball.step(400).expect("steps");
    let v = ball.v();
    near(v[0], 0.4, 1e-6);
    near(v[2], -0.2, 1e-6);
}

#[test]
fn a_floor_lifts_a_ball_and_a_snapshot_knows_where_it_is() {
    let floor = moving_floor(Vector3::new(0.0, 0.5, 0.0));
    let make = || simulation(scene(1, vec![floor], None, 0.0), &[0.0, RADIUS, 0.0]);
    let mut ball = make();
    ball.step(300).expect("steps");
    assert!((ball.q()[1] - RADIUS - 0.15).abs() < 1e-9, "{:?}", ball.q());
    assert!(ball.penetration() < 1e-9);
    let snapshot = ball.snapshot();
    ball.step(100).expect("steps");
    let mut other = make();
    other
        .restore(&snapshot)
        .expect("a snapshot of the same bed");
    other.step(100).expect("steps");
    assert_eq!(bits(ball.q()), bits(other.q()));
    ball.set_state(&[0.0, RADIUS, 0.0], &[0.0; 6])
        .expect("a state");
    assert!(
        ball.penetration() <= 0.0,
        "the floor is back where it began"
    );
}

#[test]
fn a_ball_rolls_on_the_spot_in_a_drum() {
    let drum = Drum::new(Vector3::zeros(), 1.0, 1.0, 2.0).expect("a drum");
    let bottom = [0.0, RADIUS - 1.0, 0.0];
    let mut ball = simulation(scene(1, Vec::new(), Some(Arc::new(drum)), 0.0), &bottom);
    let spin = 2.0 * 1.0 / RADIUS;
    ball.set_state(&bottom, &[0.0, 0.0, 0.0, 0.0, 0.0, spin])
        .expect("a state");
    ball.step(500).expect("steps");
    assert!(ball.q()[0].abs() < 1e-6 && (ball.q()[1] - bottom[1]).abs() < 1e-6);
    assert!((ball.v()[5] - spin).abs() < 1e-6);
    ball.set_state(&bottom, &[0.0; 6]).expect("a state");
    ball.step(50).expect("steps");
    assert!(ball.q()[0] > 1e-3, "the barrel drags it to where it goes");
}

#[test]
fn a_ball_falls_through_a_hole_that_it_fits_and_lies_beside_it() {
    let floor = Floor {
        height: 0.0,
        hole: 0.15,
    };
    let silo = Silo::new([0.0, 0.0], 0.6, Some(floor)).expect("a silo");
    let q = [0.04, RADIUS, 0.0, 0.45, RADIUS, 0.0];
    let mut balls = simulation(scene(2, Vec::new(), Some(Arc::new(silo)), 0.0), &q);
    balls.step(600).expect("steps");
    assert!(balls.q()[1] < -0.5, "it fell: {:?}", balls.q());
    assert!(balls.q()[0].hypot(balls.q()[2]) < 0.15, "through the hole");
    assert!((balls.q()[4] - RADIUS).abs() < 1e-6, "the other lies");
    assert!(balls.penetration() < 1e-4);
}

fn hangs(force: f64) -> bool {
    let ceiling = Wall::new(Vector3::zeros(), -Vector3::y()).expect("a wall");
    let mut ball = simulation(scene(1, vec![ceiling], None, force), &[0.0, -RADIUS, 0.0]);
    ball.step(200).expect("steps");
    ball.q()[1] > -1.1 * RADIUS
}

#[test]
fn cohesion_holds_a_ball_up_to_its_breaking_force() {
    let weight = MASS * G;
    assert!(hangs(1.01 * weight));
    assert!(!hangs(0.99 * weight));
    assert!(!hangs(0.0));
}

#[test]
fn cohesion_adds_to_the_load_of_friction() {
    let force = 1.5 * MASS * G;
    let own = scene(1, vec![Wall::floor(0.0)], None, force);
    let mut ball = simulation(own, &[0.0, RADIUS, 0.0]);
    ball.set_state(&[0.0, RADIUS, 0.0], &[3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        .expect("a state");
    ball.step(50).expect("steps");
    let expected = 3.0 - MU * 2.5 * G * 0.05;
    assert!((ball.v()[0] - expected).abs() < 1e-6, "{:?}", ball.v());
    let contact = &ball.contacts()[0];
    let whole = contact.impulse[0] - 1e-3 * ball.description().attraction(&contact.contact);
    assert!(
        (whole - 1e-3 * MASS * G).abs() < 1e-8,
        "it bears its weight"
    );
}

#[test]
fn two_balls_that_cohere_move_as_one_and_keep_their_momentum() {
    let own = scene(2, Vec::new(), None, 50.0);
    let mut options = exact(&own, 1e-9);
    options.gravity = Vector3::zeros();
    let q = [0.0, 0.0, 0.0, 2.0 * RADIUS, 0.0, 0.0];
    let mut pair = awake(own, options, &q);
    let mut v = [0.0; 12];
    (v[1], v[7]) = (-0.5, 0.5);
    pair.set_state(&q, &v).expect("a state");
    let before = pair.momentum();
    pair.step(1000).expect("steps");
    let apart = (0..3).map(|k| (pair.q()[k] - pair.q()[3 + k]).powi(2));
    assert!(
        (apart.sum::<f64>().sqrt() - 2.0 * RADIUS).abs() < 0.01 * RADIUS,
        "F exceeds the centrifugal force of 5 N"
    );
    let after = pair.momentum();
    assert!((before.0 - after.0).norm() < 1e-12);
    assert!((before.1 - after.1).norm() < 1e-3 * before.1.norm());
}
