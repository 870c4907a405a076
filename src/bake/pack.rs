//! Packing of rectangles by a skyline: each is put where its top comes lowest.
//!
//! The skyline is the upper outline of what is placed, a list of level steps (J. Jylänki, "A
//! thousand ways to pack the bin", 2010, section 4; here with y downward and rectangles that may be
//! turned). Rectangles come in order of their shorter side; with few of them other orders are tried
//! as well. Cost: n times the steps, which are about as many as rectangles fit into a row.

/// A rectangle to be placed, in texels, both sides at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Item {
    pub width: u32,
    pub height: u32,
    /// Whether it may be turned by a quarter.
    pub may_turn: bool,
}

/// Where a rectangle is: its corner at the top left, and whether it was turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub page: u32,
    pub x: u32,
    pub y: u32,
    pub turned: bool,
}

/// With at most so many rectangles every order is tried, not the first alone.
const FEW: usize = 500;

/// Places all items on one page; `None` when they do not fit.
pub(super) fn one_page(width: u32, height: u32, items: &[Item]) -> Option<Vec<Place>> {
    let area: u64 = items.iter().map(|i| u64::from(i.width) * u64::from(i.height)).sum();
    if area > u64::from(width) * u64::from(height) {
        return None;
    }
    let tried = if items.len() <= FEW { ORDERS.len() } else { 1 };
    ORDERS[..tried].iter().find_map(|key| {
        let mut places = vec![None; items.len()];
        let left = fill_page(width, height, items, sorted(items, *key), 0, &mut places);
        left.is_empty().then(|| places.into_iter().flatten().collect())
    })
}

/// Places all items on as many pages as it takes; how many those are comes second.
///
/// Each item must fit an empty page.
pub(super) fn pages(width: u32, height: u32, items: &[Item]) -> (Vec<Place>, u32) {
    let mut places = vec![None; items.len()];
    let (mut left, mut page) = (sorted(items, ORDERS[0]), 0);
    while !left.is_empty() {
        let before = left.len();
        left = fill_page(width, height, items, left, page, &mut places);
        debug_assert!(left.len() < before, "an item does not fit an empty page");
        if left.len() == before {
            break;
        }
        page += 1;
    }
    (places.into_iter().flatten().collect(), page)
}

type Key = fn(&Item) -> (u32, u32);

/// Larger ones first, by: shorter side, longer side, height, sum of the sides.
const ORDERS: [Key; 4] = [
    |i| (i.width.min(i.height), i.width.max(i.height)),
    |i| (i.width.max(i.height), i.width.min(i.height)),
    |i| (i.height, i.width),
    |i| (i.width.saturating_add(i.height), i.width.max(i.height)),
];

fn sorted(items: &[Item], key: Key) -> Vec<usize> {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(key(&items[i])));
    order
}

/// A level step of the skyline, from `x` to the next one's.
#[derive(Clone, Copy)]
struct Step {
    x: u32,
    y: u32,
}

/// Places items on one page in their order; those that do not fit come back.
fn fill_page(
    width: u32,
    height: u32,
    items: &[Item],
    order: Vec<usize>,
    page: u32,
    places: &mut [Option<Place>],
) -> Vec<usize> {
    let mut skyline = vec![Step { x: 0, y: 0 }];
    let mut left = vec![];
    for index in order {
        let item = items[index];
        let upright = best(&skyline, width, height, item.width, item.height);
        let turned = (item.may_turn && item.width != item.height)
            .then(|| best(&skyline, width, height, item.height, item.width))
            .flatten();
        let (spot, turned) = match (upright, turned) {
            (Some(a), Some(b)) if b.rank < a.rank => (b, true),
            (Some(a), _) => (a, false),
            (None, Some(b)) => (b, true),
            (None, None) => {
                left.push(index);
                continue;
            }
        };
        let (w, h) = if turned { (item.height, item.width) } else { (item.width, item.height) };
        places[index] = Some(Place { page, x: spot.x, y: spot.y, turned });
        raise(&mut skyline, width, spot, w, h);
    }
    left
}

/// A place for a rectangle: the step that it begins on, and how good it is (less is better).
#[derive(Clone, Copy)]
struct Spot {
    step: usize,
    x: u32,
    y: u32,
    /// The far side's y, then the area that is lost below, then x.
    rank: (u32, u64, u32),
}

/// The best place of a `w` x `h` rectangle on the skyline.
fn best(skyline: &[Step], width: u32, height: u32, w: u32, h: u32) -> Option<Spot> {
    if w > width || h > height {
        return None;
    }
    let mut best: Option<Spot> = None;
    for (step, &Step { x, .. }) in skyline.iter().enumerate() {
        if x > width - w {
            break;
        }
        let mut y = 0;
        let mut below = 0u64;
        for (k, s) in skyline[step..].iter().enumerate() {
            if s.x >= x + w {
                break;
            }
            let end = skyline.get(step + k + 1).map_or(width, |n| n.x).min(x + w);
            y = y.max(s.y);
            below += u64::from(s.y) * u64::from(end - s.x);
        }
        if y > height - h {
            continue;
        }
        let lost = u64::from(y) * u64::from(w) - below;
        let rank = (y + h, lost, x);
        if best.is_none_or(|b| rank < b.rank) {
            best = Some(Spot { step, x, y, rank });
        }
    }
    best
}

/// Raises the skyline over a rectangle that was placed.
fn raise(skyline: &mut Vec<Step>, width: u32, spot: Spot, w: u32, h: u32) {
    let (begin, end) = (spot.x, spot.x + w);
    let covered = skyline[spot.step..].iter().take_while(|s| s.x < end).count();
    let last = skyline[spot.step + covered - 1];
    let last_end = skyline.get(spot.step + covered).map_or(width, |s| s.x);
    let mut new = vec![Step { x: begin, y: spot.y + h }];
    if last_end > end {
        new.push(Step { x: end, y: last.y });
    }
    skyline.splice(spot.step..spot.step + covered, new);
    skyline.dedup_by(|b, a| a.y == b.y);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look random.
    fn numbers(mut seed: u64) -> impl FnMut(u32) -> u32 {
        move |below| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
            ((seed >> 33) as u32) % below
        }
    }

    fn items(count: usize, largest: u32, seed: u64) -> Vec<Item> {
        let mut next = numbers(seed);
        let mut side = move || 1 + next(largest);
        (0..count).map(|k| Item { width: side(), height: side(), may_turn: k % 3 != 0 }).collect()
    }

    /// Counts every cell; more than once is a fault.
    fn assert_apart(width: u32, height: u32, items: &[Item], places: &[Place]) {
        let count = places.iter().map(|p| p.page + 1).max().unwrap_or(0);
        let mut taken = vec![false; (width * height * count) as usize];
        assert_eq!(items.len(), places.len());
        for (item, place) in items.iter().zip(places) {
            assert!(!place.turned || item.may_turn);
            let (mut w, mut h) = (item.width, item.height);
            if place.turned {
                (w, h) = (h, w);
            }
            assert!(place.x + w <= width && place.y + h <= height);
            for y in place.y..place.y + h {
                for x in place.x..place.x + w {
                    let cell = &mut taken[((place.page * height + y) * width + x) as usize];
                    assert!(!std::mem::replace(cell, true));
                }
            }
        }
    }

    #[test]
    fn nothing_overlaps_and_little_is_lost() {
        for (count, largest, least) in
            [(1, 9, 0.0), (20, 60, 0.75), (300, 40, 0.85), (3000, 20, 0.85)]
        {
            let items = items(count, largest, count as u64);
            let area: u32 = items.iter().map(|i| i.width * i.height).sum();
            let mut side = f64::from(area).sqrt() as u32;
            let places = loop {
                match one_page(side, side, &items) {
                    Some(places) => break places,
                    None => side += 1,
                }
            };
            assert_apart(side, side, &items, &places);
            let share = f64::from(area) / f64::from(side * side);
            assert!(share > least, "{count}: {share}");
        }
    }

    #[test]
    fn what_does_not_fit_goes_to_further_pages() {
        let items = items(200, 30, 7);
        let (places, count) = pages(64, 48, &items);
        assert!(count > 10 && count < 30, "{count}");
        assert_apart(64, 48, &items, &places);
        assert!(one_page(64, 48, &items).is_none());
    }
}
