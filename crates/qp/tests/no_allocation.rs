//! Refilling and solving do not touch the heap.

// A global allocator cannot be written without it.
#![allow(unsafe_code)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use bikebot_qp::{BandedQp, DenseQp, Settings, Summary};
use common::{Case, Chance, Flavour, boxed_case, random_case, spline_case};

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed to the system allocator unchanged; counting touches only a
// thread-local cell that needs no allocation of its own.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: the caller's obligations are the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// The summary of a piece of work and the number of times it asked the heap.
fn counted(work: impl FnOnce() -> Summary) -> (Summary, usize) {
    let before = ALLOCATIONS.with(Cell::get);
    let summary = work();
    (summary, ALLOCATIONS.with(Cell::get) - before)
}

#[test]
fn the_counter_counts() {
    let before = ALLOCATIONS.with(Cell::get);
    drop(std::hint::black_box(vec![0u8; 16]));
    assert!(ALLOCATIONS.with(Cell::get) > before);
}

#[test]
fn a_banded_workspace_takes_no_memory_after_it_is_made() {
    let mut chance = Chance::new(1);
    let cases: Vec<Case> = (0..20)
        .map(|i| {
            if i % 2 == 0 {
                let (controls, rows) = (chance.index(20, 101), chance.index(1, 81));
                spline_case(&mut chance, controls, rows)
            } else {
                let n = chance.index(5, 201);
                random_case(&mut chance, n, 8, 80, 6, Flavour::Mixed)
            }
        })
        .collect();
    let mut qp = BandedQp::<8>::new(200, 80, 6);
    for case in &cases {
        let (summary, taken) = counted(|| {
            case.fill_banded(&mut qp);
            let first = qp.solve(&Settings::default());
            let mut start = [0.0; 200];
            start[..case.n].copy_from_slice(qp.x());
            qp.start_from(&start[..case.n]).unwrap();
            assert!(qp.solve(&Settings::default()).is_solved());
            first
        });
        assert!(summary.is_solved(), "{summary:?}");
        assert_eq!(taken, 0);
    }
}

#[test]
fn a_dense_workspace_takes_no_memory_after_it_is_made() {
    let mut chance = Chance::new(2);
    let cases: Vec<Case> = (0..20)
        .map(|i| {
            let rows = chance.index(1, 101);
            if i % 2 == 0 {
                boxed_case(&mut chance, 30, rows, Flavour::Mixed)
            } else {
                random_case(&mut chance, 30, 30, rows, 3, Flavour::Mixed)
            }
        })
        .collect();
    let mut qp = DenseQp::new(30, 100, 3);
    let mut fresh: Vec<DenseQp> = cases.iter().map(Case::dense).collect();
    for (case, fresh) in cases.iter().zip(&mut fresh) {
        let (summary, taken) = counted(|| fresh.solve(&Settings::default()));
        assert!(summary.is_solved(), "{summary:?}");
        assert_eq!(taken, 0, "solving");

        let (g, bounds) = (case.gradient.clone(), case.rows.clone());
        qp.clear_rows();
        let (_, taken) = counted(|| {
            qp.set_hessian(&[0.0; 900]).unwrap();
            qp.set_gradient(&g).unwrap();
            for i in 0..30 {
                qp.set_box(i, -1.0, 1.0).unwrap();
            }
            for row in &bounds {
                let mut full = [0.0; 30];
                full[row.first..row.first + row.a.len()].copy_from_slice(&row.a);
                qp.add_elastic_row(&full, row.bound, 3.0).unwrap();
            }
            qp.set_bound(0, 0.0).unwrap();
            qp.add_equality(&[0.5; 30], 0.0).unwrap();
            qp.solve(&Settings::default())
        });
        assert_eq!(taken, 0, "refilling");
    }
}
