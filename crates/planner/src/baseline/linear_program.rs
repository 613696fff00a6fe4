//! The row "LP" of Table 2 read as *linear programme*: a unit of flow from start to goal at least cost.
//!
//! Variables are the flows f ≥ 0 on the arcs between free neighbouring cells, sides and corners; minimise Σ length · f
//! subject to conservation at every cell, +1 at the start and −1 at the goal. The optimum is the length of the shortest path on
//! the grid, which exceeds the shortest in the plane by up to 8.2 %.
//!
//! Solved by Clarabel's interior point. Where several shortest paths are equally long, an interior-point solution is a
//! mixture of all of them; lengths are therefore told apart by up to a part in 10⁴, by a fixed rule, so that one of
//! them wins.

use super::cell_grid::{CELLS_PER_ITERATION, CellGrid};
use crate::budget::Meter;
use bikebot_geometry::Point2;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver as _, SolverStatus, SupportedConeT,
};
use std::sync::{Mutex, mpsc};
use std::thread;

/// Neighbours, as columns and rows.
const NEIGHBOURS: [(isize, isize); 8] = [
    (1, 0),
    (1, 1),
    (0, 1),
    (-1, 1),
    (-1, 0),
    (-1, -1),
    (0, -1),
    (1, -1),
];
/// By how much, relatively, arcs of equal length are told apart.
const TELL_APART: f64 = 1e-4;
/// The solver's relative tolerance: well below what tells two paths apart.
const TOLERANCE: f64 = 1e-8;
/// Flow below this is taken for none.
const LEAST_FLOW: f64 = 1e-6;
/// Not a node.
const NONE: usize = usize::MAX;

/// A directed arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Index of the node it leaves.
    pub from: usize,
    /// Index of the node it enters.
    pub to: usize,
    /// What a unit of flow costs on it, m.
    pub length: f64,
}

/// A graph of free cells and the arcs between them.
#[derive(Debug, Clone, PartialEq)]
pub struct FlowGraph {
    /// Position of each node, m.
    pub nodes: Vec<Point2>,
    /// Arcs, in the order of the nodes they leave.
    pub arcs: Vec<Arc>,
    /// The node flow comes from.
    pub start: usize,
    /// The node flow goes to.
    pub goal: usize,
}

/// The optimal flow.
#[derive(Debug, Clone, PartialEq)]
pub struct Flow {
    /// Σ length · flow, m.
    pub cost: f64,
    /// Flow on each arc.
    pub on: Vec<f64>,
    /// Iterations the solver took.
    pub iterations: u32,
}

impl FlowGraph {
    /// The cells reachable from `start`, with all free arcs between neighbours. `None` if `goal` is not among them, or the
    /// budget ended first.
    #[must_use]
    pub fn new(
        grid: &CellGrid<'_, '_>,
        start: usize,
        goal: usize,
        meter: &mut Meter<'_>,
    ) -> Option<Self> {
        let mut node_of = vec![NONE; grid.cells()];
        let mut cells = vec![start];
        node_of[start] = 0;
        let mut arcs = Vec::new();
        let mut next = 0;
        while let Some(&cell) = cells.get(next) {
            if next.is_multiple_of(CELLS_PER_ITERATION) && !meter.step() {
                return None;
            }
            for &(dx, dy) in &NEIGHBOURS {
                let Some(other) = grid.neighbour(cell, dx, dy) else {
                    continue;
                };
                if !(grid.is_free(other) && grid.is_arc_free(cell, other)) {
                    continue;
                }
                if node_of[other] == NONE {
                    node_of[other] = cells.len();
                    cells.push(other);
                }
                let length = grid.side() * ((dx * dx + dy * dy) as f64).sqrt();
                arcs.push(Arc {
                    from: next,
                    to: node_of[other],
                    length: length * (1.0 + TELL_APART * scatter(cell, other)),
                });
            }
            next += 1;
        }
        (node_of[goal] != NONE).then(|| Self {
            nodes: cells.iter().map(|&cell| grid.centre(cell)).collect(),
            arcs,
            start: 0,
            goal: node_of[goal],
        })
    }

    /// The flow of least cost. `None` if the solver does not reach its tolerance or the budget ended first; each of its
    /// iterations is one of the budget.
    #[must_use]
    pub fn cheapest_flow(&self, meter: &mut Meter<'_>) -> Option<Flow> {
        if self.start == self.goal {
            return Some(Flow {
                cost: 0.0,
                on: vec![0.0; self.arcs.len()],
                iterations: 0,
            });
        }
        let (nodes, arcs) = (self.nodes.len(), self.arcs.len());
        // Conservation at every node but the goal, where it follows from the others; then −f ≤ 0.
        let row = |node: usize| match node.cmp(&self.goal) {
            std::cmp::Ordering::Less => Some(node),
            std::cmp::Ordering::Equal => None,
            std::cmp::Ordering::Greater => Some(node - 1),
        };
        let mut begin = Vec::with_capacity(arcs + 1);
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        begin.push(0);
        for (k, arc) in self.arcs.iter().enumerate() {
            let mut column = [(row(arc.from), 1.0), (row(arc.to), -1.0)];
            column.sort_by_key(|(row, _)| *row);
            for (row, value) in column {
                if let Some(row) = row {
                    rows.push(row);
                    values.push(value);
                }
            }
            rows.push(nodes - 1 + k);
            values.push(-1.0);
            begin.push(rows.len());
        }
        let height = nodes - 1 + arcs;
        let matrix = CscMatrix::new(height, arcs, begin, rows, values);
        let mut right = vec![0.0; height];
        if let Some(row) = row(self.start) {
            right[row] = 1.0;
        }
        let costs: Vec<f64> = self.arcs.iter().map(|arc| arc.length).collect();
        let cones = [
            SupportedConeT::ZeroConeT(nodes - 1),
            SupportedConeT::NonnegativeConeT(arcs),
        ];
        let settings = DefaultSettings {
            verbose: false,
            presolve_enable: false,
            tol_gap_abs: TOLERANCE,
            tol_gap_rel: TOLERANCE,
            tol_feas: TOLERANCE,
            ..DefaultSettings::default()
        };
        let none = CscMatrix::zeros((arcs, arcs));
        let solver = DefaultSolver::new(&none, &costs, &matrix, &right, &cones, settings).ok()?;
        watched(solver, meter)
    }

    /// The path the flow follows, as nodes from start to goal: always along the arc with most flow that leads to a node not
    /// seen before, back where there is none.
    #[must_use]
    pub fn path(&self, flow: &Flow) -> Option<Vec<usize>> {
        let mut leaving = vec![Vec::new(); self.nodes.len()];
        for (arc, &f) in self.arcs.iter().zip(&flow.on) {
            if f > LEAST_FLOW {
                leaving[arc.from].push((f, arc.to));
            }
        }
        for arcs in &mut leaving {
            // The greatest last, to be taken first.
            arcs.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        }
        let mut seen = vec![false; self.nodes.len()];
        seen[self.start] = true;
        let mut path = vec![self.start];
        while let Some(&node) = path.last() {
            if node == self.goal {
                return Some(path);
            }
            match leaving[node].pop() {
                Some((_, to)) if !seen[to] => {
                    seen[to] = true;
                    path.push(to);
                }
                Some(_) => {}
                None => {
                    path.pop();
                }
            }
        }
        None
    }
}

/// A number in [0, 1) for each arc, of no pattern (the finalizer of MurmurHash3).
fn scatter(from: usize, to: usize) -> f64 {
    let mut h = (from as u64) << 32 ^ to as u64;
    h = (h ^ h >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    h = (h ^ h >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    h ^= h >> 33;
    (h >> 11) as f64 * (0.5f64).powi(53)
}

/// Solves, asking the meter before every iteration. The solver's hook may borrow nothing, so it runs on a thread of its
/// own and asks from there.
fn watched(solver: DefaultSolver<f64>, meter: &mut Meter<'_>) -> Option<Flow> {
    let (ask, asked) = mpsc::channel();
    let (answer, answers) = mpsc::channel();
    let answers = Mutex::new(answers);
    let mut solver = solver;
    solver.set_termination_callback(move |_| {
        let goes_on = ask.send(()).is_ok()
            && answers
                .lock()
                .is_ok_and(|answers| answers.recv().unwrap_or(false));
        !goes_on
    });
    thread::scope(|scope| {
        let solving = thread::Builder::new().spawn_scoped(scope, move || {
            solver.solve();
            let solution = &mut solver.solution;
            (solution.status == SolverStatus::Solved).then(|| Flow {
                cost: solution.obj_val,
                on: std::mem::take(&mut solution.x),
                iterations: solution.iterations,
            })
        });
        // Ends when the solver, and with it the hook, is gone.
        for () in asked {
            if answer.send(meter.step_dearly()).is_err() {
                break;
            }
        }
        solving.ok()?.join().ok()?
    })
}

/// The shortest path on the grid from `start` to `goal` (m), both included. `None` if the grid shows no way, or the budget
/// ended first, which the meter tells.
#[must_use]
pub fn search(
    grid: &CellGrid<'_, '_>,
    start: Point2,
    goal: Point2,
    meter: &mut Meter<'_>,
) -> Option<Vec<Point2>> {
    let (from, to) = (grid.attach(start)?, grid.attach(goal)?);
    let graph = FlowGraph::new(grid, from, to, meter)?;
    let flow = graph.cheapest_flow(meter)?;
    let mut path = vec![start];
    path.extend(graph.path(&flow)?.into_iter().map(|node| graph.nodes[node]));
    path.push(goal);
    Some(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::{Budget, CutShort};
    use crate::motion::MotionChecker;
    use crate::test_scenes::{block, load, room};
    use bikebot_world::{Footprint, World};
    use std::collections::BinaryHeap;

    fn graph(world: &World, ends: [Point2; 2], side: f64) -> FlowGraph {
        let checker = MotionChecker::new(world, &Footprint::Point, 0.0, 0.02);
        let meter = &mut Meter::new(&Budget::unlimited());
        let grid = CellGrid::lay(&checker, side, meter).unwrap();
        let [from, to] = ends.map(|p| grid.attach(p).unwrap());
        FlowGraph::new(&grid, from, to, meter).unwrap()
    }

    /// Dijkstra 1959, in nanometres so that a heap of integers will do.
    fn shortest(graph: &FlowGraph) -> f64 {
        let mut leaving = vec![Vec::new(); graph.nodes.len()];
        for arc in &graph.arcs {
            leaving[arc.from].push((arc.to, (arc.length * 1e9).round() as u64));
        }
        let mut distance = vec![u64::MAX; graph.nodes.len()];
        distance[graph.start] = 0;
        let mut open = BinaryHeap::from([(std::cmp::Reverse(0), graph.start)]);
        while let Some((std::cmp::Reverse(d), node)) = open.pop() {
            if d > distance[node] {
                continue;
            }
            for &(to, length) in &leaving[node] {
                if d + length < distance[to] {
                    distance[to] = d + length;
                    open.push((std::cmp::Reverse(d + length), to));
                }
            }
        }
        distance[graph.goal] as f64 * 1e-9
    }

    #[test]
    fn its_optimum_is_dijkstras() {
        for (name, side) in [("fig6", 2.0), ("fig6", 1.0), ("narrow", 1.0)] {
            let scene = load(name);
            let ends = [scene.start.position, scene.goal.position];
            let graph = graph(&scene.world, ends, side);
            let flow = graph.cheapest_flow(&mut Meter::new(&Budget::unlimited()));
            let (flow, exact) = (flow.unwrap(), shortest(&graph));
            assert!(
                (flow.cost / exact - 1.0).abs() < 1e-6,
                "{name}: {} {exact}",
                flow.cost
            );
            // The path read off the flow is the shortest one itself, up to the solver's tolerance.
            let path = graph.path(&flow).unwrap();
            let length: f64 = path
                .windows(2)
                .map(|leg| {
                    let arc = |arc: &&Arc| arc.from == leg[0] && arc.to == leg[1];
                    graph.arcs.iter().find(arc).unwrap().length
                })
                .sum();
            assert!(
                (length / exact - 1.0).abs() < 1e-6,
                "{name}: {length} {exact}"
            );
        }
    }

    #[test]
    fn of_many_equal_paths_it_follows_one() {
        let world = room(12.0, vec![]);
        let graph = graph(&world, [Point2::new(1.5, 1.5), Point2::new(10.5, 5.5)], 1.0);
        let flow = graph
            .cheapest_flow(&mut Meter::new(&Budget::unlimited()))
            .unwrap();
        assert!(flow.on.iter().all(|f| *f < 0.01 || *f > 0.99));
        assert_eq!(graph.path(&flow).unwrap().len(), 10);
    }

    #[test]
    fn a_budget_ends_it_between_two_iterations() {
        let world = room(12.0, vec![block(4.0, 0.0, 5.0, 8.0)]);
        let graph = graph(&world, [Point2::new(1.5, 1.5), Point2::new(10.5, 1.5)], 1.0);
        let mut meter = Meter::new(&Budget::of_iterations(3));
        assert_eq!(graph.cheapest_flow(&mut meter), None);
        assert_eq!(meter.cut_short(), Some(CutShort::Iterations));
        assert_eq!(meter.iterations(), 3);
    }
}
