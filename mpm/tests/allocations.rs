//! No memory is allocated in a step once buffers have grown.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use common::*;
use mpm::{
    Domain, DruckerPrager, DruckerPragerParameters, Numerics, Obstacle, Points, Solver, Vec2, Walls,
};

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// In one thread, as rayon's own queues may grow when there are several.
#[test]
fn a_step_allocates_nothing_after_warm_up() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let law = DruckerPragerParameters::default();
        let faces = Walls::default();
        let plate = Obstacle {
            min: Vec2::new(2.0, 0.0),
            max: Vec2::new(2.5, 1.0),
            faces,
            velocity: Vec2::new(-0.1, 0.0),
            start: 0.0,
        };
        let domain = Domain { size: Vec2::new(4.0, 3.0), walls: faces, cell: 0.1 };
        let numerics = Numerics { cell_average_volumetric: true, ..Numerics::default() };
        let mut solver =
            Solver::new(domain, numerics, Vec2::new(0.0, -GRAVITY), vec![plate]).unwrap();
        let mut points = Points::rectangle(Vec2::zeros(), Vec2::new(1.0, 1.0), 0.05, law.density);
        let mut material = DruckerPrager::new(law, &points.stress).unwrap();
        let mut advance = |steps| {
            for _ in 0..steps {
                solver.advance(&mut points, &mut material, 2.0e-4).unwrap();
            }
        };
        advance(10);
        let before = COUNT.get();
        // Long enough for points to spread over many more cells.
        advance(2000);
        assert_eq!(COUNT.get() - before, 0);
    });
}
