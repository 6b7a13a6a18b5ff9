#[path = "../../../tests/physics/sand.rs"]
mod sand;
