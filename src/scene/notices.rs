//! The list of oddities while a file is being read.

use std::collections::HashMap;

use super::Notice;

/// Collects notices in the order of their first occurrence; equal ones are counted.
#[derive(Debug, Default)]
pub(crate) struct Notices {
    list: Vec<Notice>,
    places: HashMap<(String, String), usize>,
}

impl Notices {
    /// Adds one occurrence.
    pub(crate) fn add(&mut self, about: impl Into<String>, text: impl Into<String>) {
        self.add_many(about, text, 1);
    }

    /// Adds `count` occurrences; nothing when there are none.
    pub(crate) fn add_many(
        &mut self,
        about: impl Into<String>,
        text: impl Into<String>,
        count: usize,
    ) {
        if count == 0 {
            return;
        }
        let key = (about.into(), text.into());
        if let Some(&place) = self.places.get(&key) {
            self.list[place].count += count;
            return;
        }
        self.places.insert(key.clone(), self.list.len());
        self.list.push(Notice { about: key.0, text: key.1, count });
    }

    /// The finished list.
    pub(crate) fn into_list(self) -> Vec<Notice> {
        self.list
    }
}

/// Notices that say the same of several things as one, which names the first of them; in order.
pub fn group_notices(notices: &[Notice]) -> Vec<Notice> {
    // The first notice with each text and how many further ones there are; the map only finds the
    // place.
    let mut groups: Vec<(Notice, usize)> = Vec::new();
    let mut places: HashMap<&str, usize> = HashMap::new();
    for notice in notices {
        match places.get(notice.text.as_str()) {
            Some(&place) => {
                groups[place].0.count += notice.count;
                groups[place].1 += 1;
            }
            None => {
                places.insert(&notice.text, groups.len());
                groups.push((notice.clone(), 0));
            }
        }
    }
    groups
        .into_iter()
        .map(|(mut notice, others)| {
            if others > 0 {
                notice.about.push_str(&format!(" and {others} more"));
            }
            notice
        })
        .collect()
}
