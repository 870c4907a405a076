//! The library asked as a row is computed: one search a source, then its quadtree with the list
//! of shadows inherited and narrowed.

use glam::DVec2;
use lumel::geometry::polygon::twice_area;
use lumel::geometry::{Frame, Pieces};
use lumel::kernel::View;
use lumel::mesh::child;
use lumel::visibility::{Coverage, Observer, Occluders, Shadows};

use super::scenes::Sight;

/// A quadtree node and what was found of it.
pub struct Cell {
    /// Its corners in the source's plane.
    pub corners: [DVec2; 3],
    /// Levels below the source.
    pub depth: u32,
    /// What `narrow` said; `Full` where no shadow was left above it.
    pub coverage: Coverage,
    /// Its visible pieces, for a leaf.
    pub pieces: Option<Vec<Vec<DVec2>>>,
}

/// What the library says of a source.
pub struct Look {
    /// The source's plane.
    pub frame: Frame,
    /// All nodes that were met, parents before children.
    pub cells: Vec<Cell>,
    /// Whether `find` found no shadow.
    pub clear: bool,
    /// Visible area above the horizon, square metres.
    pub visible: f64,
}

/// Looks at the source refined `levels` times.
pub fn look(sight: &Sight, levels: u32) -> Look {
    let occluders = Occluders::build(&sight.blockers);
    let observer = Observer { occluders: &occluders, point: sight.point, normal: sight.normal };
    let frame = Frame::of_triangle(&sight.source).unwrap();
    let corners = sight.source.map(|x| frame.project(x));
    let horizon = View::new(&frame, sight.point, sight.normal).horizon(occluders.magnitude);
    let (mut shadows, mut active) = (Shadows::default(), vec![]);
    let mut look = Look { frame, cells: vec![], clear: false, visible: 0.0 };
    if horizon.nowhere_positive(&corners) {
        return look;
    }
    shadows.look_from(&observer);
    shadows.find(&observer, &frame, &corners, &mut active);
    look.clear = active.is_empty();
    descend(&mut look, &mut shadows, &mut active, &corners, 0, levels, 0);
    let mut risen = Pieces::default();
    for piece in look.cells.iter().flat_map(|c| c.pieces.iter().flatten()) {
        risen.push_clipped(piece, &horizon);
    }
    look.visible = 0.5 * risen.iter().map(twice_area).sum::<f64>();
    look
}

fn descend(
    look: &mut Look,
    shadows: &mut Shadows,
    active: &mut Vec<u32>,
    corners: &[DVec2; 3],
    depth: u32,
    levels: u32,
    from: usize,
) {
    let to = active.len();
    let coverage = if from < to { shadows.narrow(corners, active, from) } else { Coverage::Full };
    let leaf = depth == levels || coverage == Coverage::Hidden;
    let pieces = leaf.then(|| match coverage {
        Coverage::Full => vec![corners.to_vec()],
        Coverage::Hidden => vec![],
        Coverage::Partial => {
            shadows.visible(corners, &active[to..]).iter().map(<[DVec2]>::to_vec).collect()
        }
    });
    look.cells.push(Cell { corners: *corners, depth, coverage, pieces });
    if !leaf {
        for k in 0..4 {
            descend(look, shadows, active, &child(corners, k), depth + 1, levels, to);
        }
    }
    active.truncate(to);
}
