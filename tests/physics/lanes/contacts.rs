//! Contacts, their Jacobian and operator: within rounding of the sources for any machine, every
//! lane with the bits of the same source run as `f64`.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use rover_core::contact::slots::contacts::{ContactSlots, DetectionInput};
use rover_core::contact::slots::ground::BlockGround;
use rover_core::contact::slots::machine::SharedMachine;
use rover_core::contact::slots::rows::{ContactMatrices, ContactQuantity};
use rover_core::contact::{
    self, Activation, Contact, ContactKey, ContactSystem, PairSearch, Part, generalized_impulse,
    relocate,
};
use rover_core::geometry::{Plane, Rocks, SphereField, Terrain};
use rover_core::multibody::description::SolidDescription;
use rover_core::multibody::inertias::Inertias;
use rover_core::multibody::lane_configuration::LaneConfiguration;
use rover_core::multibody::poses::Poses;
use rover_core::multibody::{
    Configuration, Factor, Kinematics, MassMatrix, Model, ModelDescription,
};
use rover_core::scalar::{Lane, LaneMask, Single, Vec3};
use rover_core::solver::batch::problem::ContactProblem;

use super::{OverLanes, on_every_register, spread};
use crate::shared::{Numbers, flat};
use crate::wheels::wheel_scenes::wide_rover;

const G: f64 = 9.81;
const THETA: f64 = 0.5;
const MU: f64 = 0.7;

/// A rover on its ground.
#[derive(Clone)]
struct Rover {
    q: Configuration,
    v: Vec<f64>,
    terrain: Arc<dyn Terrain>,
}

/// Step and forecast.
#[derive(Clone, Copy)]
struct Step {
    h: f64,
    gamma: f64,
}

impl Step {
    fn lead(self) -> f64 {
        self.gamma * self.h - (1.0 - THETA) * self.h
    }
}

/// What a step finds of a rover; one that falls back has no numbers.
#[derive(Clone, Debug, Default, PartialEq)]
struct Found {
    falls_back: bool,
    keys: Vec<ContactKey>,
    geometry: Vec<f64>,
    u_before: Vec<f64>,
    operator: Vec<f64>,
    local: Vec<f64>,
    y: Vec<f64>,
    impulse: Vec<f64>,
}

/// The lane sources, with the memory that lasts from step to step.
struct Block<T: Lane> {
    token: T::Token,
    machine: SharedMachine,
    models: Vec<Option<Arc<Model>>>,
    inertias: Inertias<T>,
    ground: BlockGround<T>,
    contacts: ContactSlots<T>,
    rows: ContactMatrices<T>,
    problems: Vec<ContactProblem>,
}

impl<T: Lane> Block<T> {
    fn new(token: T::Token, model: &Model, rovers: &[Rover]) -> Self {
        assert_eq!(rovers.len(), T::LANES);
        let machine = SharedMachine::of(model);
        let mut inertias = Inertias::new(token, &machine);
        let mut ground = BlockGround::new(token, machine.wheels.len(), machine.boxes.len());
        for (lane, rover) in rovers.iter().enumerate() {
            inertias.set_lane(lane, model.inertias());
            ground.set_lane(lane, &rover.terrain);
        }
        let contacts = ContactSlots::new(token, &machine);
        Self {
            token,
            rows: ContactMatrices::new(token, &machine, contacts.n_slots()),
            machine,
            models: vec![Some(Arc::new(model.clone())); T::LANES],
            inertias,
            ground,
            contacts,
            problems: vec![ContactProblem::default(); T::LANES],
        }
    }

    fn step(&mut self, rovers: &[Rover], step: Step) -> Vec<Found> {
        let Self {
            token,
            machine,
            inertias: _,
            ..
        } = self;
        let token = *token;
        let mut start = LaneConfiguration::new(token, machine);
        for (lane, rover) in rovers.iter().enumerate() {
            start.set_lane(lane, &rover.q);
        }
        let v = spread(token, rovers, |rover| rover.v.clone());
        let machine = &self.machine;
        let inertias = &self.inertias;
        let mut poses = Vec::new();
        for h in [(1.0 - THETA) * step.h, step.h] {
            let mut place = start.clone();
            T::vectorize(token, || place.set_moved(machine, &start, &v, h));
            let mut of_place = Poses::new(token, machine);
            of_place.update(machine, inertias, &place);
            poses.push(of_place);
        }
        let (middle, end) = (&poses[0], &poses[1]);
        let gravity = Vec3::splat(token, [0.0, -G, 0.0]);
        let activation = Activation::of_step(gravity, step.h, step.gamma, (1.0 - THETA) * step.h);
        let input = DetectionInput {
            machine,
            models: &self.models,
            going: (1 << T::LANES) - 1,
            middle,
            end,
            v: &v,
            needs_pieces: false,
            activation: &activation,
        };
        let fallbacks = self.contacts.detect(&mut self.ground, &input);
        let mut M = MassMatrix::new(token, machine);
        M.update(machine, inertias, middle);
        let mut factor = Factor::new(token, machine);
        assert!(M.factorise(machine, &mut factor).all());
        self.rows
            .assemble((machine, &factor), end, &self.contacts, &v, None);
        let zero = T::splat(token, 0.0);
        let mut q = vec![[zero; 3]; self.contacts.n_slots()];
        let change = spread(token, rovers, |_| (0..v.len()).map(number).collect());
        T::vectorize(token, || self.rows.local(&self.contacts, &change, &mut q));
        let mu = vec![T::splat(token, MU); self.contacts.n_slots()];
        self.rows
            .to_problems(&self.contacts, (&q, &mu), &mut self.problems, None);
        for problem in &mut self.problems {
            for (k, p) in problem.p.iter_mut().enumerate() {
                *p = number(k);
            }
        }
        let mut p = vec![[zero; 3]; self.contacts.n_slots()];
        let mut y = change;
        let mut impulse = vec![zero; v.len()];
        let all = T::mask(token, u32::MAX);
        T::vectorize(token, || {
            self.rows.read(
                &self.contacts,
                &self.problems,
                ContactQuantity::Impulses,
                &mut p,
            );
            (self.rows).add_impulses(&self.contacts, all, &p, &mut y, None);
            self.rows
                .generalized_impulse(machine, &self.contacts, end, all, &p, &mut impulse);
        });
        (0..T::LANES)
            .map(|lane| {
                if fallbacks.get(lane) {
                    return Found {
                        falls_back: true,
                        ..Found::default()
                    };
                }
                let mut found = Found {
                    y: y.iter().map(|y| y.get(lane)).collect(),
                    impulse: impulse.iter().map(|x| x.get(lane)).collect(),
                    ..Found::default()
                };
                let list = self.contacts.list(lane);
                let problem = &self.problems[lane];
                assert_eq!(problem.n_contacts, list.n);
                let n = list.n;
                found.local = problem.q[..3 * n].to_vec();
                assert!(
                    problem.mu[..n]
                        .iter()
                        .all(|&mu| mu.to_bits() == MU.to_bits())
                );
                for c in 0..n {
                    let slot = usize::from(list.slots[c]);
                    let (_, contact) = self.contacts.contact(machine, lane, c);
                    found.keys.push(contact.key);
                    let own = self.contacts.slot(slot);
                    assert!(own.active.get(lane));
                    for x in [own.point, own.n, own.t, own.b] {
                        found.geometry.extend(x.get(lane));
                    }
                    found.geometry.push(own.gap.get(lane));
                    found
                        .u_before
                        .extend(self.rows.u_before[slot].map(|u| u.get(lane)));
                }
                found.operator = vec![0.0; 9 * n * n];
                for c in 0..n {
                    for d in 0..=c {
                        for i in 0..3 {
                            for j in 0..3 {
                                let (row, column) = (3 * c + i, 3 * d + j);
                                let entry = problem.entry(row, column);
                                found.operator[row * 3 * n + column] = entry;
                                found.operator[column * 3 * n + row] = entry;
                            }
                        }
                    }
                }
                found
            })
            .collect()
    }
}

fn number(k: usize) -> f64 {
    (1.3 * k as f64 + 0.4).sin()
}

/// The same by the sources for any machine, contacts in the same order; none where the ground is
/// unknown, and where there are more contacts than slots if the other has fallen back.
fn expected(model: &Model, rover: &Rover, step: Step, found: &Found) -> Option<Found> {
    let keys = &found.keys[..];
    let moved = |h: f64| {
        let mut q = rover.q.clone();
        q.set_moved(model, &rover.q, &rover.v, h);
        let mut kinematics = Kinematics::new(model);
        kinematics.update_for_step(model, &q);
        kinematics
    };
    let (middle, end) = (moved((1.0 - THETA) * step.h), moved(step.h));
    let activation = Activation {
        lead: step.lead(),
        hover: 0.5 * G * step.h * step.h,
        slow: 2.0 * G * step.h,
    };
    let mut contacts = Vec::new();
    let unknown = contact::detect(
        model,
        &middle,
        &end,
        &*rover.terrain,
        &rover.v,
        &activation,
        &mut contacts,
    );
    if unknown.is_some() {
        return None;
    }
    let mut pairs = PairSearch::new(model);
    contact::detect_pairs(
        model,
        &middle,
        &rover.v,
        &activation,
        &mut pairs,
        &mut contacts,
    );
    if found.falls_back && contacts.len() > 6 {
        return None;
    }
    assert_eq!(contacts.len(), keys.len(), "{contacts:?}, {keys:?}");
    let place = |contact: &Contact| {
        let is_own = |key: &ContactKey| [contact.key, contact.key.lasting()].contains(key);
        let place = keys.iter().position(is_own);
        place.unwrap_or_else(|| panic!("{contact:?} is not among {keys:?}"))
    };
    contacts.sort_by_key(place);
    for contact in &mut contacts {
        relocate(model, &end, &*rover.terrain, contact);
    }
    let (token, mechanism) = (Single::best(), model.mechanism());
    let mut M = MassMatrix::new(token, mechanism);
    M.update(mechanism, model.inertias(), middle.poses());
    let mut factor = Factor::new(token, mechanism);
    assert!(M.factorise(mechanism, &mut factor));
    let at_end = (end.poses(), &rover.v[..]);
    let system = ContactSystem::of(model, at_end, &factor, &contacts);
    let change: Vec<f64> = (0..model.nv()).map(number).collect();
    let n = contacts.len();
    let mut local = vec![0.0; 3 * n];
    system.local(model, &change, &mut local);
    for (q, u) in local.iter_mut().zip(&system.u) {
        *q += u;
    }
    let p: Vec<f64> = (0..3 * n).map(number).collect();
    let mut y = change;
    system.add_impulses(model, &p, &mut y);
    let mut impulse = vec![0.0; model.nv()];
    generalized_impulse(model, end.poses(), &contacts, &p, &mut impulse);
    let mut found = Found {
        falls_back: false,
        u_before: system.u.clone(),
        operator: system.W.clone(),
        local,
        y,
        impulse,
        ..Found::default()
    };
    for contact in &contacts {
        for x in [
            contact.point,
            contact.frame.n,
            contact.frame.t,
            contact.frame.b,
        ] {
            found.geometry.extend(x.iter());
        }
        found.geometry.push(contact.gap);
    }
    Some(found)
}

fn assert_close(name: &str, a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len(), "{name}");
    let scale = b.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        assert!(
            (a - b).abs() <= tolerance * scale,
            "{name}[{k}]: {a} and {b}"
        );
    }
}

/// A rover whose lowest wheel is about as deep as `depth`, m, over its plane or a random place.
fn rover(
    model: &Model,
    terrain: &Arc<dyn Terrain>,
    random: &mut Numbers,
    depth: f64,
    tilt: f64,
) -> Rover {
    let mut q = Configuration::zero(model);
    // Over every ground of these tests: the rug of spheres begins at the origin.
    q.position = Vector3::new(5.5 + 3.0 * random.next(), 0.0, 5.5 + 3.0 * random.next());
    let about = Vector3::new(
        random.next(),
        3.0 * random.next() / tilt.max(1e-3),
        random.next(),
    );
    q.attitude = UnitQuaternion::from_scaled_axis(about * tilt);
    for angle in &mut q.joints {
        *angle = 0.2 * random.next();
    }
    let lowest = |q: &Configuration| {
        let kinematics = Kinematics::of(model, q);
        let contacts = contact::detection::wheel_contacts(model, &kinematics, &**terrain);
        contacts.iter().fold(f64::INFINITY, |low, c| low.min(c.gap))
    };
    q.position.y = 1.5;
    for _ in 0..30 {
        q.position.y -= 0.9 * lowest(&q);
    }
    q.position.y -= depth * (0.6 + 0.4 * random.next());
    let mut v: Vec<f64> = (0..model.nv()).map(|_| random.next()).collect();
    for v in &mut v[9..] {
        *v *= 4.0;
    }
    Rover {
        q,
        v,
        terrain: Arc::clone(terrain),
    }
}

fn rocks(seed: u64, abundance: f64) -> Arc<dyn Terrain> {
    let rocks = Rocks {
        abundance,
        seed,
        max_diameter: 0.25,
        ground: Plane::new([0.1, 1.0, -0.05], 0.2).unwrap(),
        ..Rocks::default()
    };
    Arc::new(SphereField::rocks(&rocks).unwrap())
}

/// Grounds of every kind: planes, rocks on a plane, and spheres alone.
fn grounds() -> Vec<Arc<dyn Terrain>> {
    vec![
        flat(),
        Arc::new(Plane::new([-0.2, 1.0, 0.1], 0.4).unwrap()),
        rocks(1, 0.05),
        rocks(2, 0.2),
        Arc::new(SphereField::rug()),
        Arc::new(SphereField::new(&[], &[], Some(Plane::ground())).unwrap()),
        super::surfaces::level(0.3),
        super::surfaces::hills(0.25, 5),
        super::surfaces::hills_with_rocks(6),
    ]
}

/// Returns whether the lanes have taken the step.
fn check(model: &Model, rover: &Rover, step: Step, found: &Found) -> bool {
    let Some(right) = expected(model, rover, step, found) else {
        assert!(found.falls_back);
        return false;
    };
    assert!(!found.falls_back);
    // On planes and surfaces one formula serves both: a restored rover, which finds by one way what
    // it found by the other, once went on with other bits.
    let is_one = !rover.terrain.can_be_passed();
    let tolerance = if is_one { 0.0 } else { 1e-13 };
    assert_close("geometry", &found.geometry, &right.geometry, tolerance);
    assert_close("velocity before", &found.u_before, &right.u_before, 1e-12);
    assert_close("operator", &found.operator, &right.operator, 1e-12);
    assert_close("local velocity", &found.local, &right.local, 1e-12);
    assert_close("factor coordinates", &found.y, &right.y, 1e-12);
    assert_close("impulse", &found.impulse, &right.impulse, 1e-12);
    true
}

fn bits(found: &[Found]) -> Vec<Vec<u64>> {
    let all = |f: &Found| {
        [
            &f.geometry,
            &f.u_before,
            &f.operator,
            &f.local,
            &f.y,
            &f.impulse,
        ]
        .iter()
        .flat_map(|part| part.iter().map(|x| x.to_bits()))
        .collect()
    };
    found.iter().map(all).collect()
}

const STEPS: [Step; 3] = [step(0.005, 0.5), step(0.005, 1.0), step(0.02, 0.4)];

const fn step(h: f64, gamma: f64) -> Step {
    Step { h, gamma }
}

#[test]
fn contacts_agree_with_those_of_any_machine() {
    contacts_agree(&Model::rover());
}

#[test]
fn contacts_of_wheels_with_a_width_agree_with_those_of_any_machine() {
    for [width, rounding] in TREADS {
        contacts_agree(&wide_rover(width, rounding));
    }
}

/// Widths and roundings of a torus, a cylinder and a cylinder with round edges, m.
const TREADS: [[f64; 2]; 3] = [[0.06, 0.03], [0.1, 0.0], [0.1, 0.03]];

/// The built-in rover with a box and a ball below its trunk, which can touch the ground and other
/// bodies.
fn cluttered() -> Model {
    let mut description = ModelDescription::rover();
    let shapes = "name = \"one\"\n[[solids]]\nname = \"a\"\nmass = 2.0\nshapes = [\n\
                  { kind = \"box\", size = [0.5, 0.5, 0.1], collides = true },\n\
                  { kind = \"sphere\", radius = 0.12, position = [0.3, -0.25, 0.1], collides = true },\n]\n";
    let template = description.solids[1].clone();
    description.solids.push(SolidDescription {
        name: "mast".into(),
        parent: Some("trunk".into()),
        position: Some([-0.2, -0.05, 0.1]),
        hold: None,
        shape: None,
        collides: false,
        shapes: ModelDescription::from_toml(shapes).unwrap().solids[0]
            .shapes
            .clone(),
        ..template
    });
    description.self_contact = true;
    Model::from_description(description).unwrap()
}

#[test]
fn contacts_of_boxes_and_balls_agree() {
    let kinds = contacts_agree(&cluttered());
    for (kind, least) in [("box", 10), ("ball", 40)] {
        assert!(kinds.get(kind).is_some_and(|n| *n > least), "{kinds:?}");
    }
}

/// Returns the numbers of contacts by kind.
fn contacts_agree(model: &Model) -> BTreeMap<&'static str, usize> {
    let mut random = Numbers(1);
    let mut kinds = BTreeMap::new();
    for terrain in grounds() {
        for k in 0..40 {
            let depth = [1e-4, 0.01, 0.05][k % 3];
            let tilt = [0.0, 0.1, 0.3, 1.5][k / 10];
            let rover = rover(model, &terrain, &mut random, depth, tilt);
            let step = STEPS[k % 2 + usize::from(k % 7 == 0)];
            let mut block = Block::<f64>::new(Single::best(), model, std::slice::from_ref(&rover));
            let found = &block.step(std::slice::from_ref(&rover), step)[0];
            if !check(model, &rover, step, found) {
                *kinds.entry("fallback").or_default() += 1;
            }
            for key in &found.keys {
                let kind = match (key.opposite, key.part >> 14) {
                    (contact::Opposite::Part(_), _) => "pair",
                    (_, 1) => "ball",
                    (_, 2) => "box",
                    (contact::Opposite::Ground(0), _) => "plane",
                    _ => "rock",
                };
                *kinds.entry(kind).or_default() += 1;
            }
        }
    }
    assert!(
        kinds["plane"] > 100
            && kinds["rock"] > 30
            && kinds["box"] > 1
            && *kinds.get("fallback").unwrap_or(&0) < 30,
        "{kinds:?}"
    );
    kinds
}

fn lanes_agree<T: Lane>(token: T::Token) {
    let grounds = grounds();
    lanes_agree_on::<T>(token, &Model::rover(), &grounds);
    lanes_agree_on::<T>(token, &cluttered(), &grounds);
    for [width, rounding] in TREADS {
        lanes_agree_on::<T>(token, &wide_rover(width, rounding), &grounds);
    }
}

fn lanes_agree_on<T: Lane>(token: T::Token, model: &Model, grounds: &[Arc<dyn Terrain>]) {
    let mut random = Numbers(2);
    for k in 0..40 {
        let rovers: Vec<Rover> = (0..T::LANES)
            .map(|lane| {
                let terrain = &grounds[if k < 10 {
                    k % 2
                } else {
                    (k + lane * lane) % grounds.len()
                }];
                rover(model, terrain, &mut random, 0.02, [0.0, 0.2][k % 2])
            })
            .collect();
        let step = STEPS[k % 3];
        let found = Block::<T>::new(token, model, &rovers).step(&rovers, step);
        for (lane, rover) in rovers.iter().enumerate() {
            let rover = std::slice::from_ref(rover);
            let alone = Block::<f64>::new(Single::best(), model, rover).step(rover, step);
            assert_eq!(found[lane].falls_back, alone[0].falls_back);
            assert_eq!(found[lane].keys, alone[0].keys);
            assert_eq!(bits(&found[lane..=lane]), bits(&alone), "lane {lane}");
        }
    }
}

struct LanesAgree;

impl OverLanes for LanesAgree {
    fn run<T: Lane>(&mut self, token: T::Token) {
        lanes_agree::<T>(token);
    }
}

#[test]
fn every_lane_has_the_bits_of_a_rover_alone() {
    on_every_register(&mut LanesAgree);
}

/// The trunk moves by four times its distance from the rock in half a step, along it.
#[test]
fn a_trunk_touches_a_rock_no_sooner_than_it_should() {
    let model = Model::rover();
    let mut random = Numbers(5);
    let mut rover = rover(&model, &flat(), &mut random, 1e-4, 0.0);
    rover.v.fill(0.0);
    let step = STEPS[2];
    let put = |rover: &mut Rover, y: f64| {
        let centre = [rover.q.position.x, y, rover.q.position.z];
        let rock = SphereField::new(&[centre], &[0.1], Some(Plane::ground())).unwrap();
        rover.terrain = Arc::new(rock);
        let own = std::slice::from_ref(&*rover);
        let found = &Block::<f64>::new(Single::best(), &model, own).step(own, step)[0];
        assert!(check(&model, rover, step, found));
        found.keys.iter().any(|key| key.part >= Part::Box(0).code())
    };
    let (mut below, mut above) = (-0.1, rover.q.position.y);
    assert!(!put(&mut rover, below) && put(&mut rover, above));
    while above - below > 1e-6 {
        let y = 0.5 * (below + above);
        *(if put(&mut rover, y) {
            &mut above
        } else {
            &mut below
        }) = y;
    }
    rover.v[0] = 1.0;
    for (distance, touches) in [(-1e-3, true), (2.5e-3, false), (5e-3, false)] {
        assert_eq!(put(&mut rover, below - distance), touches);
    }
}

/// Spheres are kept from step to step. A rover that comes from elsewhere finds what one finds that
/// has just been put there.
#[test]
fn what_a_search_keeps_does_not_show() {
    let model = Model::rover();
    let mut random = Numbers(3);
    for terrain in [
        rocks(3, 0.2),
        Arc::new(SphereField::rug()) as Arc<dyn Terrain>,
        super::surfaces::level(0.1),
        super::surfaces::hills(0.2, 3),
        super::surfaces::hills_with_rocks(4),
    ] {
        let mut rover = rover(&model, &terrain, &mut random, 0.01, 0.05);
        let mut block = Block::<f64>::new(Single::best(), &model, std::slice::from_ref(&rover));
        for k in 0..120 {
            let stride = [0.002, 0.02, 0.3][k / 40];
            rover.q.position +=
                Vector3::new(random.next(), 0.05 * random.next(), random.next()) * stride;
            let here = std::slice::from_ref(&rover);
            let fresh = Block::<f64>::new(Single::best(), &model, here).step(here, STEPS[0]);
            let found = block.step(here, STEPS[0]);
            assert_eq!(
                (found[0].falls_back, &found[0].keys),
                (fresh[0].falls_back, &fresh[0].keys)
            );
            assert_eq!(bits(&found), bits(&fresh));
        }
    }
}
