//! Resolves coplanar overlaps: where two sides lie in one plane and face the same way, one stays.
//!
//! Both would radiate and receive, and light would be counted twice: the form factors of what sees
//! them would add up to more than one. (A side that lies in the plane of another one does not hide
//! it: visibility begins beyond roundings.)
//!
//! **What overlaps.** Two triangles whose common part is wider than the contact distance
//! ([`crate::geometry::CONTACT`]) and nowhere farther apart than that, with radiating sides that
//! face the same way. Two one-sided triangles back to back are a plate, and a block's bottom on the
//! floor faces the other way than the floor: neither is an overlap.
//!
//! **What stays.** Of two sides, the one that is higher along their normal by more than the
//! roundings of a file ([`Scene::rounding`]): what lies on the floor hides it. If
//! neither is, that of the smaller patch (triangles of one object joined by edges in one plane):
//! rugs and decals lie on floors and walls. Else the later one in the file. Where this contradicts
//! itself (a over b over c over a), larger patches go below.
//!
//! **What goes.** From each triangle the parts that others cover are cut away ([`carve`]); the rest
//! stays as triangles with interpolated texture coordinates and vertex colours. The two sides of a
//! two-sided triangle are lost each for itself: a part that lost one radiates on the other side
//! only, with a one-sided copy of its material. The back of a one-sided triangle is black and
//! hides as well: a two-sided sheet on a one-sided wall keeps its front, and its other side, which
//! would look through the hole in the wall, is dark.
//!
//! **What is kept.** Wherever light was blocked it still is, within the contact distance: in every
//! point the last side in the order stays. The order is one for all, so nothing is cut in a circle.
//! Too many overlaps ([`MOST_PAIRS`]) or too many parts ([`carve::MOST_PARTS`]) are left as they
//! are, with a notice: light is then counted twice there.
//!
//! Cost: O((n + k) log n) for n triangles with k pairs of near ones, and for each triangle the
//! number of its parts times that of what covers it.

mod carve;
mod order;
mod outline;
mod pairs;

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::hygiene::about;
use super::notices::Notices;
use super::{Scene, Triangle};
use crate::geometry::{Bounds, contact_distance, known_to};
use carve::{BACK, Cover, FRONT, Part, carve};
use pairs::{Pair, Plate};

/// Most pairs of overlapping triangles that are resolved: 200 MB of them. Files with one flat heap
/// of thousands of triangles could ask for the square of their number.
const MOST_PAIRS: usize = 1 << 22;

/// What was done about coplanar overlaps; the report shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overlaps {
    /// Pairs of triangles that overlap in one plane with sides that face the same way.
    pub pairs: usize,
    /// Triangles of which parts, or parts of one side, were taken away.
    pub cut: usize,
    /// Triangles of which nothing is left.
    pub covered: usize,
    /// Triangles that overlap others still: they would be in too many parts, or there are too many
    /// pairs.
    pub left: usize,
}

/// Cuts away what others in one plane cover, counted in [`Scene::overlaps`] and in notices by
/// object. A scene without overlaps stays as it is, bit for bit.
pub fn resolve(scene: &mut Scene) {
    let bounds =
        scene.triangles.iter().fold(Bounds::EMPTY, |b, t| b.union(Bounds::of(&t.vertices)));
    let tolerance = contact_distance(bounds, scene.rounding);
    let two_sided: Vec<bool> = scene.triangles.iter().map(|t| is_two_sided(scene, t)).collect();
    let plates: Vec<Option<Plate>> =
        scene.triangles.par_iter().map(|t| Plate::new(&t.vertices)).collect();
    let Some(found) = pairs::find(&plates, &two_sided, tolerance, MOST_PAIRS) else {
        scene.overlaps.left = scene.triangles.len();
        scene.notices.push(super::Notice {
            about: "scene".into(),
            text: "faces overlap in one plane too often to be resolved: light is counted twice \
                   there"
                .into(),
            count: 1,
        });
        return;
    };
    scene.overlaps = Overlaps { pairs: found.len(), ..Overlaps::default() };
    if found.is_empty() {
        return;
    }
    let rank = order::ranks(scene, &plates, &two_sided, &found, known_to(bounds, scene.rounding));
    let covers = covers(&found, &two_sided, &rank, scene.triangles.len());
    let carved: Vec<Carved> = (0..scene.triangles.len())
        .into_par_iter()
        .map(|i| {
            let sides = if two_sided[i] { FRONT | BACK } else { FRONT };
            if covers[i].iter().all(|c| c.lost | c.dark == 0) {
                return Carved::Whole;
            }
            match carve(&scene.triangles[i].vertices, sides, &covers[i], &plates, tolerance) {
                None => Carved::Left,
                Some(parts) if parts[..].iter().any(|p| p.is_whole(sides)) => Carved::Whole,
                Some(parts) => Carved::Parts(parts),
            }
        })
        .collect();
    replace(scene, carved);
}

fn is_two_sided(scene: &Scene, triangle: &Triangle) -> bool {
    scene.materials.get(triangle.material as usize).is_some_and(|m| m.two_sided)
}

/// What each triangle is covered by.
fn covers(
    pairs: &[Pair],
    two_sided: &[bool],
    rank: &dyn Fn(u32, u8) -> (u32, u32),
    triangles: usize,
) -> Vec<Vec<Cover>> {
    let mut covers: Vec<Vec<Cover>> = vec![vec![]; triangles];
    for pair in pairs {
        for (of, by) in [(pair.a, pair.b), (pair.b, pair.a)] {
            let mut cover = Cover { by, lost: 0, dark: 0, spared: 0 };
            // The side of `by` that faces as a side of `of` does.
            let facing = |side: u8| if pair.same { side } else { side ^ (FRONT | BACK) };
            let radiates = |i: u32, side: u8| side == FRONT || two_sided[i as usize];
            for side in [FRONT, BACK] {
                if !radiates(of, side) {
                    continue;
                }
                let its = facing(side);
                let one_sided = !two_sided[by as usize];
                if radiates(by, its) {
                    if rank(by, its) > rank(of, side) {
                        cover.lost |= side;
                    }
                    if one_sided {
                        cover.spared |= side;
                    }
                } else {
                    // A black back: `of` is two-sided, or the two would not overlap.
                    let (other, front) = (side ^ (FRONT | BACK), its ^ (FRONT | BACK));
                    if rank(of, other) > rank(by, front) {
                        cover.dark |= side;
                    }
                }
            }
            covers[of as usize].push(cover);
        }
    }
    covers
}

/// What became of a triangle.
enum Carved {
    /// Nothing covers it.
    Whole,
    /// It is covered, but would be in too many parts.
    Left,
    /// What is left of it.
    Parts(Vec<Part>),
}

/// Puts the parts in the place of their triangles.
fn replace(scene: &mut Scene, carved: Vec<Carved>) {
    let mut notices = Notices::default();
    let mut counts: BTreeMap<(u32, &str), usize> = BTreeMap::new();
    let mut one_sided: BTreeMap<u32, u32> = BTreeMap::new();
    let before = std::mem::take(&mut scene.triangles);
    for (triangle, carved) in before.into_iter().zip(carved) {
        let text = match &carved {
            Carved::Whole => None,
            Carved::Left => {
                scene.overlaps.left += 1;
                Some(
                    "faces that others in one plane cover left whole: they would be in too many \
                      parts, and light is counted twice there",
                )
            }
            Carved::Parts(parts) if parts.is_empty() => {
                scene.overlaps.covered += 1;
                Some("faces left out: others in the same plane cover them")
            }
            Carved::Parts(_) => {
                scene.overlaps.cut += 1;
                Some("faces that overlap others in one plane cut")
            }
        };
        if let Some(text) = text {
            *counts.entry((triangle.object, text)).or_default() += 1;
        }
        let Carved::Parts(parts) = carved else {
            scene.triangles.push(triangle);
            continue;
        };
        for part in parts {
            let mut piece = part.of(&triangle);
            let material = &scene.materials[triangle.material as usize];
            if material.two_sided && part.sides != FRONT | BACK {
                let mut copy = material.clone();
                let last = scene.materials.len() as u32;
                piece.material = *one_sided.entry(triangle.material).or_insert(last);
                if piece.material == last {
                    copy.name = format!("{}, one side", copy.name);
                    copy.two_sided = false;
                    scene.materials.push(copy);
                }
                if part.sides == BACK {
                    piece.reverse();
                }
            }
            scene.triangles.push(piece);
        }
    }
    for ((object, text), count) in counts {
        notices.add_many(about(scene, object), text, count);
    }
    scene.notices.extend(notices.into_list());
}
