//! Runs of sources of one face: their occluders are cast as shadows once, not for each source.

/// Sources of one face that follow each other.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Their range in the list of sources.
    pub sources: (usize, usize),
    /// The range of their occluders in [`Runs::candidates`].
    pub candidates: (usize, usize),
    /// Where the places of the first source begin in [`Runs::places`].
    pub places: usize,
}

/// All runs of a list of sources.
#[derive(Clone, Debug, Default)]
pub struct Runs {
    /// The runs.
    pub list: Vec<Run>,
    /// Occluders of one run after the other, each once in a run.
    pub candidates: Vec<u32>,
    /// For each source in turn its occluders, as places in the list of its run.
    pub places: Vec<u32>,
}

impl Runs {
    /// Finds the runs of `sources[from..]`, of each of which `of` tells the face and the range of its
    /// occluders in `occluders`. What was there before is forgotten.
    pub fn find<S>(
        &mut self,
        sources: &[S],
        from: usize,
        occluders: &[u32],
        of: impl Fn(&S) -> (u32, (u32, u32)),
    ) {
        self.list.clear();
        self.candidates.clear();
        self.places.clear();
        let mut begin = from;
        while begin < sources.len() {
            let face = of(&sources[begin]).0;
            let same = sources[begin..].iter().take_while(|s| of(s).0 == face).count();
            let (first, places) = (self.candidates.len(), self.places.len());
            for source in &sources[begin..begin + same] {
                let (_, (from, to)) = of(source);
                for &i in &occluders[from as usize..to as usize] {
                    let known = self.candidates[first..].iter().position(|&c| c == i);
                    let place = known.unwrap_or_else(|| {
                        self.candidates.push(i);
                        self.candidates.len() - 1 - first
                    });
                    self.places.push(place as u32);
                }
            }
            let sources = (begin, begin + same);
            self.list.push(Run { sources, candidates: (first, self.candidates.len()), places });
            begin += same;
        }
    }
}
