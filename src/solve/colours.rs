//! Which colour channels need a solution of their own.

use glam::DVec3;

/// Channels that are solved, and how the others follow.
#[derive(Clone, Debug, PartialEq)]
pub struct Colours {
    /// Channels that are solved.
    pub solved: Vec<usize>,
    /// For each channel its place in `solved` and a factor; none for a dark one.
    source: [Option<(usize, f64)>; 3],
}

impl Colours {
    /// A channel without light is dark. A channel whose reflectance is that of an earlier one, and
    /// whose light is in proportion to that of the earlier one to a few roundings, has the earlier
    /// one's solution in that proportion.
    pub fn of(reflectance: &[DVec3], exitance: &[DVec3]) -> Colours {
        let mut colours = Colours { solved: vec![], source: [None; 3] };
        for c in 0..3 {
            let strongest = exitance.iter().map(|e| e[c]).fold(0.0, f64::max);
            if strongest == 0.0 {
                continue;
            }
            let earlier = colours.solved.iter().enumerate().find_map(|(place, &first)| {
                let factor = strongest / exitance.iter().map(|e| e[first]).fold(0.0, f64::max);
                let same = reflectance.iter().all(|rho| rho[c] == rho[first])
                    && exitance
                        .iter()
                        .all(|e| (e[c] - factor * e[first]).abs() <= 2.0 * f64::EPSILON * e[c]);
                same.then_some((place, factor))
            });
            colours.source[c] = Some(earlier.unwrap_or_else(|| {
                colours.solved.push(c);
                (colours.solved.len() - 1, 1.0)
            }));
        }
        colours
    }

    /// The three channels from those that were solved.
    pub fn spread<const C: usize>(&self, solved: &[f64; C]) -> DVec3 {
        let channel = |c: usize| self.source[c].map_or(0.0, |(place, f)| f * solved[place]);
        DVec3::new(channel(0), channel(1), channel(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_in_proportion_share_a_solution() {
        let grey = vec![DVec3::splat(0.5), DVec3::splat(0.25)];
        let light = |e: DVec3| vec![e, DVec3::ZERO];
        let solved = |rho: &[DVec3], e: &[DVec3]| Colours::of(rho, e).solved;
        assert_eq!(solved(&grey, &light(DVec3::ONE)), [0]);
        assert!(solved(&grey, &light(DVec3::ZERO)).is_empty());
        assert_eq!(solved(&grey, &light(DVec3::new(0.0, 3.0, 0.3))), [1]);
        let red = vec![DVec3::new(0.6, 0.5, 0.5), DVec3::splat(0.25)];
        assert_eq!(solved(&red, &light(DVec3::new(1.0, 0.7, 0.1))), [0, 1]);
        let two_lamps = vec![DVec3::ONE, DVec3::new(1.0, 0.5, 1.0)];
        assert_eq!(solved(&grey, &two_lamps), [0, 1]);
        let colours = Colours::of(&grey, &light(DVec3::new(2.0, 0.0, 0.5)));
        assert_eq!(colours.spread(&[8.0]), DVec3::new(8.0, 0.0, 2.0));
    }
}
