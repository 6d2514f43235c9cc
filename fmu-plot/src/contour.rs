//! Areas where a field is at or above a level: their outlines, and the contour lines along them.
//!
//! The field has values at the points of a grid of rows and columns, which may lie anywhere in the plane. Each quadrilateral of
//! four neighbors is cut into four triangles around its center, which has the mean of their values; in a triangle the field is
//! linear. Shared edges of triangles cancel: the remaining edges of an area are its outline, and those between two points
//! inside grid edges are the contour. A quadrilateral with a value that is not finite belongs to no area.

use std::collections::{BTreeMap, HashSet};

/// A point of the plane.
pub type Place = (f64, f64);

/// A field on a grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Field {
    /// Number of points in a row.
    pub columns: usize,
    /// Coordinates of the grid's points, row by row.
    pub places: Vec<Place>,
    /// Values there; one that is not finite is missing.
    pub values: Vec<f64>,
}

/// The part of the plane with values at or above a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Above {
    /// Closed outlines; they bound the area under the even-odd or the nonzero rule.
    pub rings: Vec<Vec<Place>>,
    /// The stretches of the outlines along which the field has the level: the contour.
    pub lines: Vec<Vec<Place>>,
}

/// A vertex of an outline: a point of the grid or a center (the same number twice), or the crossing of the edge between two.
type Vertex = (usize, usize);

impl Field {
    /// The area where the field is at or above `level`; with minus infinity, all points with a value.
    pub fn above(&self, level: f64) -> Above {
        let mut edges: HashSet<(Vertex, Vertex)> = HashSet::new();
        for triangle in self.triangles() {
            let outline = self.clip(triangle, level);
            for (k, &from) in outline.iter().enumerate() {
                let to = outline[(k + 1) % outline.len()];
                if !edges.remove(&(to, from)) {
                    edges.insert((from, to));
                }
            }
        }
        // In a fixed order, so that equal fields give equal outlines.
        let mut next: BTreeMap<Vertex, Vec<Vertex>> = BTreeMap::new();
        let mut sorted: Vec<_> = edges.into_iter().collect();
        sorted.sort_unstable();
        for (from, to) in sorted {
            next.entry(from).or_default().push(to);
        }
        let mut above = Above::default();
        while let Some((&start, _)) = next.first_key_value() {
            let mut ring = vec![start];
            let mut at = start;
            while let Some(to) = follow(&mut next, at).filter(|to| *to != start) {
                ring.push(to);
                at = to;
            }
            above.lines.extend(contours(&ring).into_iter().map(|line| self.places_of(&line, level)));
            above.rings.push(self.places_of(&ring, level));
        }
        above
    }

    fn triangles(&self) -> impl Iterator<Item = [usize; 3]> {
        let (n, rows) = (self.columns, self.places.len().checked_div(self.columns).unwrap_or(0));
        let squares = (1..rows).flat_map(move |row| (1..n).map(move |column| (row, column)));
        squares.flat_map(move |(row, column)| {
            let last = row * n + column;
            let corners = [last - n - 1, last - n, last, last - 1];
            let whole = corners.iter().all(|&k| self.values[k].is_finite());
            // Centers are numbered after the points.
            let middle = self.places.len() + last;
            (0..if whole { 4 } else { 0 }).map(move |k| [middle, corners[k], corners[(k + 1) % 4]])
        })
    }

    fn mean<T>(&self, vertex: usize, of: impl Fn(usize) -> T) -> T
    where
        T: std::iter::Sum<T> + std::ops::Mul<f64, Output = T>,
    {
        let last = vertex - self.places.len();
        [last - self.columns - 1, last - self.columns, last, last - 1].into_iter().map(of).sum::<T>() * 0.25
    }

    fn value(&self, vertex: usize) -> f64 {
        self.values.get(vertex).copied().unwrap_or_else(|| self.mean(vertex, |k| self.values[k]))
    }

    fn place(&self, vertex: usize) -> Place {
        let middle = || (self.mean(vertex, |k| self.places[k].0), self.mean(vertex, |k| self.places[k].1));
        self.places.get(vertex).copied().unwrap_or_else(middle)
    }

    /// The part of a triangle at or above the level.
    fn clip(&self, triangle: [usize; 3], level: f64) -> Vec<Vertex> {
        let inside = triangle.map(|k| self.value(k) >= level);
        let mut outline = Vec::with_capacity(4);
        for k in 0..3 {
            let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
            if inside[k] {
                outline.push((from, from));
            }
            if inside[k] != inside[(k + 1) % 3] {
                outline.push((from.min(to), from.max(to)));
            }
        }
        outline
    }

    fn places_of(&self, vertices: &[Vertex], level: f64) -> Vec<Place> {
        let place = |&(a, b): &Vertex| {
            let (p, q) = (self.place(a), self.place(b));
            let share = if a == b { 0.0 } else { (level - self.value(a)) / (self.value(b) - self.value(a)) };
            (p.0 + share * (q.0 - p.0), p.1 + share * (q.1 - p.1))
        };
        vertices.iter().map(place).collect()
    }
}

/// Takes an edge that starts at `from`, and returns its end.
fn follow(next: &mut BTreeMap<Vertex, Vec<Vertex>>, from: Vertex) -> Option<Vertex> {
    let ends = next.get_mut(&from)?;
    let to = ends.pop();
    if ends.is_empty() {
        next.remove(&from);
    }
    to
}

/// The stretches of an outline between crossings; one that is a contour all around ends where it starts.
fn contours(ring: &[Vertex]) -> Vec<Vec<Vertex>> {
    let is_crossing = |k: usize| ring[k % ring.len()].0 != ring[k % ring.len()].1;
    let Some(start) = (0..ring.len()).find(|&k| !is_crossing(k)) else {
        return vec![ring.iter().chain(ring.first()).copied().collect()];
    };
    let around: Vec<usize> = (start..start + ring.len()).collect();
    let stretches = around.split(|&k| !is_crossing(k)).filter(|stretch| stretch.len() > 1);
    stretches.map(|stretch| stretch.iter().map(|k| ring[k % ring.len()]).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(ring: &[Place]) -> f64 {
        let pairs = ring.iter().zip(ring.iter().cycle().skip(1));
        0.5 * pairs.map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum::<f64>()
    }

    /// A hill over -1..1 squared.
    fn hill(n: u32, f: impl Fn(f64, f64) -> f64) -> Field {
        let at = |k: u32| 2.0 * f64::from(k) / f64::from(n - 1) - 1.0;
        let places: Vec<Place> = (0..n * n).map(|k| (at(k % n), at(k / n))).collect();
        let values = places.iter().map(|&(x, y)| f(x, y)).collect();
        Field { columns: usize::try_from(n).unwrap(), places, values }
    }

    #[test]
    fn the_contour_of_a_cone_is_a_circle() {
        let above = hill(81, |x, y| 1.0 - x.hypot(y)).above(0.4);
        assert_eq!((above.rings.len(), above.lines.len()), (1, 1));
        assert!(above.lines[0].iter().all(|(x, y)| (x.hypot(*y) - 0.6).abs() < 1e-3));
        assert_eq!(above.lines[0].first(), above.lines[0].last(), "closed");
        let size = area(&above.rings[0]);
        assert!((size.abs() / (std::f64::consts::PI * 0.36) - 1.0).abs() < 2e-3, "{size}");
    }

    #[test]
    fn an_outline_follows_the_border_and_its_contour_does_not() {
        let above = hill(5, |x, _| x).above(0.3);
        assert_eq!(above.rings.len(), 1);
        assert!((area(&above.rings[0]).abs() - 2.0 * 0.7).abs() < 1e-12);
        assert_eq!(above.lines.len(), 1);
        assert!(above.lines[0].iter().all(|p| (p.0 - 0.3).abs() < 1e-12), "{:?}", above.lines);
        let all = hill(5, |x, _| x).above(f64::NEG_INFINITY);
        assert!((area(&all.rings[0]).abs() - 4.0).abs() < 1e-12 && all.lines.is_empty());
        assert_eq!(hill(5, |x, _| x).above(2.0), Above::default());
    }

    /// A hole has its own outline; a missing value removes the quadrilaterals around it.
    #[test]
    fn holes_and_missing_values() {
        let ring = hill(41, |x, y| -(x.hypot(y) - 0.5).abs()).above(-0.2);
        let sizes: Vec<f64> = ring.rings.iter().map(|r| area(r)).collect();
        assert!(sizes.len() == 2 && sizes[0] * sizes[1] < 0.0, "{sizes:?}");
        let mut field = hill(5, |_, _| 1.0);
        field.values[12] = f64::NAN;
        let total: f64 = field.above(0.0).rings.iter().map(|r| area(r)).sum();
        assert!((total.abs() - 3.0).abs() < 1e-12, "{total}");
        assert_eq!(Field::default().above(0.0), Above::default());
    }
}
