//! A solve allocates nothing once its workspace has the size.

mod solver_scenes;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use rover_core::solver::{Method, SolverOptions, SolverWorkspace, solve};
use solver_scenes::{falling, pile};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn no_method_allocates_in_a_sized_workspace() {
    // The larger problem sizes the workspace, the smaller one alternates with it.
    let large = pile(&[1.0, 1e2, 1.0], 0.9).problem(&falling(3, 0.01));
    let small = pile(&[1.0], 0.5).problem(&[0.3, -0.01, 0.0, 0.0, 0.1, 0.0]);
    let mut workspace = SolverWorkspace::with_capacity(large.mu.len(), 3);
    for method in [
        Method::Auto,
        Method::GaussSeidel,
        Method::Newton,
        Method::ProximalPoint,
        Method::Admm,
        Method::Relaxed,
    ] {
        let options = SolverOptions {
            method,
            max_sweeps: 100,
            ..SolverOptions::default()
        };
        for problem in [&large, &small, &large] {
            let n = problem.q.len();
            let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
            let view = problem.view();
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            let report = solve(&view, &options, &mut p, &mut u, &mut workspace);
            let after = ALLOCATIONS.load(Ordering::Relaxed);
            assert_eq!(after, before, "{method:?} allocates, {report:?}");
        }
    }
}
