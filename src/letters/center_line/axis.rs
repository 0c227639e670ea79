//! The medial axis of an outline, as a graph.
//!
//! Samples of the outline are triangulated (Delaunay). The circumcenters of the triangles inside
//! the ink become nodes, which are linked if their triangles have a common side. With denser
//! samples the graph approaches the set of centers of all discs that touch the outline twice
//! (Brandt and Algazi, CVGIP 55, 1992). The radius of a node's disc is half the stroke's width at
//! the node.

use spade::{DelaunayTriangulation, Point2, Triangulation};

use super::super::outline::Filled;
use super::super::vector::direction;
use noctograph_core::geometry::distance;

/// Spacing of the grid to which samples are rounded, in cap heights.
const SAMPLE_GRID: f64 = 1e-6;

/// A graph of disc centers. Nodes that were cut off remain, but without neighbors.
#[derive(Debug, Default)]
pub(super) struct Axis {
    pub(super) middles: Vec<[f64; 2]>,
    pub(super) radii: Vec<f64>,
    pub(super) neighbors: Vec<Vec<usize>>,
}

/// A path between two nodes, including both. The path along a loop ends with its first node.
pub(super) type Path = Vec<usize>;

impl Axis {
    /// Returns the axis of the ink inside an outline, in cap heights. The samples on the outline
    /// are the corners of triangles, whose circumcenters in the ink are the nodes. The axis is
    /// empty if there is no ink.
    pub(super) fn new(ink_edges: &[Vec<[f64; 2]>], ink: &Filled<'_>) -> Self {
        // Samples are rounded to a grid, because contours with a common edge would otherwise have
        // samples that differ only by rounding.
        let samples = ink_edges
            .iter()
            .flatten()
            .map(|sample| sample.map(|x| (x / SAMPLE_GRID).round() * SAMPLE_GRID));
        let samples = samples.map(|[x, y]| Point2::new(x, y)).collect();
        let Ok(mesh) = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(samples) else {
            return Self::default();
        };
        let mut axis = Self::default();
        let mut node_of = vec![None; mesh.num_all_faces()];
        for face in mesh.inner_faces() {
            let (middle, radius_squared) = face.circumcircle();
            let middle = [middle.x, middle.y];
            let centroid = face.center();
            // Samples on a straight side are not exactly collinear. They form slivers, whose
            // circumcenters are far away.
            if ink.holds([centroid.x, centroid.y]) && ink.holds(middle) {
                node_of[face.fix().index()] = Some(axis.middles.len());
                axis.middles.push(middle);
                axis.radii.push(radius_squared.sqrt());
            }
        }
        // Centers are linked by Voronoi edges, which are the duals of the triangles' sides.
        axis.neighbors = vec![Vec::new(); axis.middles.len()];
        for side in mesh.undirected_edges() {
            let faces = [side.as_directed().face(), side.as_directed().rev().face()];
            if let [Some(a), Some(b)] = faces.map(|face| node_of[face.fix().index()]) {
                axis.neighbors[a].push(b);
                axis.neighbors[b].push(a);
            }
        }
        axis
    }

    /// Returns the number of neighbors of a node.
    pub(super) fn degree(&self, node: usize) -> usize {
        self.neighbors[node].len()
    }

    /// Returns the length in cap heights of a path along its nodes.
    pub(super) fn length(&self, path: &[usize]) -> f64 {
        path.windows(2).map(|step| self.distance(step[0], step[1])).sum()
    }

    /// Returns the distance in cap heights between two nodes.
    pub(super) fn distance(&self, a: usize, b: usize) -> f64 {
        distance(self.middles[a], self.middles[b])
    }

    /// Returns the path from a node through a neighbor, up to a node for which `is_end` is true, to
    /// a node without another neighbor, or back to its start. Nodes in between have two neighbors.
    pub(super) fn path(&self, from: usize, through: usize, is_end: &dyn Fn(usize) -> bool) -> Path {
        let mut path = vec![from, through];
        loop {
            let (before, node) = (path[path.len() - 2], path[path.len() - 1]);
            if is_end(node) || node == from {
                return path;
            }
            match self.neighbors[node].iter().find(|next| **next != before) {
                Some(next) => path.push(*next),
                None => return path,
            }
        }
    }

    /// Returns the unit vector from a node to the point at distance `length` in cap heights along
    /// the path through a neighbor, or to the end of a shorter path.
    pub(super) fn heading(&self, from: usize, through: usize, length: f64) -> [f64; 2] {
        let path = self.path(from, through, &|node| self.degree(node) != 2);
        let mut walked = 0.0;
        let step = path.windows(2).find(|step| {
            walked += self.distance(step[0], step[1]);
            walked >= length
        });
        let end = self.middles[step.map_or(path[path.len() - 1], |step| step[1])];
        direction(self.middles[from], end)
    }

    /// Returns all paths between nodes for which `is_end` is true, and all loops without such a
    /// node.
    pub(super) fn paths(&self, is_end: &dyn Fn(usize) -> bool) -> Vec<Path> {
        let mut seen = vec![false; self.middles.len()];
        let mut paths = Vec::new();
        for node in (0..self.middles.len()).filter(|node| is_end(*node)) {
            seen[node] = true;
            for next in &self.neighbors[node] {
                let path = self.path(node, *next, is_end);
                path[1..path.len() - 1].iter().for_each(|inner| seen[*inner] = true);
                let end = path[path.len() - 1];
                // Each path is traced from both of its ends, and a loop in both directions.
                let back = (end, path[path.len() - 2]);
                if (node, *next) <= back {
                    paths.push(path);
                }
            }
        }
        // Any node that is not on a path between ends belongs to a loop.
        for node in 0..self.middles.len() {
            if !seen[node] && self.degree(node) == 2 {
                let path = self.path(node, self.neighbors[node][0], &|_| false);
                path.iter().for_each(|inner| seen[*inner] = true);
                paths.push(path);
            }
        }
        paths
    }

    /// Removes the links between the nodes that follow each other on a path.
    pub(super) fn cut(&mut self, path: &[usize]) {
        for step in path.windows(2) {
            self.neighbors[step[0]].retain(|node| *node != step[1]);
            self.neighbors[step[1]].retain(|node| *node != step[0]);
        }
    }
}
