//! A linter for scenes: what keeps light from being as its maker expects.
//!
//! Rays are cast from points spread over the surface (a fixed number, in fixed directions: the same
//! report in every run), and what they meet tells most of it:
//!
//! | file | what is found |
//! |---|---|
//! | `closure` | does the scene let light out: everywhere (open), or through small gaps (leaks)? |
//! | `turned`, `buried` | objects whose backs face the rest of the scene; things inside of others |
//! | `emitters` | scenes without light, lamps whose light goes nowhere |
//! | `row_sums` | points that see more than the whole hemisphere: surfaces counted twice |
//! | `reading` | what reading the file found, slivers, faces that nearly touch |
//! | `parts`, `points`, `look` | connected parts of objects; where rays begin; what they meet |
//! | `light` | whether light comes to a part |
//! | `finding` | what a finding is, in words |
//!
//! A part is what is connected by common corners within one object. The share of rays, spread over
//! the hemisphere like cos/pi, is that of the light which a surface of equal radiosity sends there.
//! Defects are found if enough of those rays meet them: a gap that a millionth of them would pass may
//! go unseen.
//!
//! Cost: about 2^21 rays, some seconds of exact row sums, and a mesh: O(n log n) for n triangles.

mod buried;
mod closure;
mod emitters;
mod finding;
mod light;
mod look;
mod parts;
mod points;
mod reading;
mod row_sums;
mod turned;

use glam::DVec3;
use rayon::prelude::*;

use crate::error::Result;
use crate::monitor::Monitor;
use crate::scene::{self, Notice, Scene};

pub use closure::{Closure, Enclosure};
pub use finding::{Finding, Kind, Severity};
pub use row_sums::RowSums;

use look::{Look, Looker};
use parts::Parts;
use points::Point;

/// What was found in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Audit {
    /// Points of the surface from which rays were cast.
    pub points: usize,
    /// Rays from each.
    pub rays: u32,
    /// Objects that are so many that no point lies on them.
    pub objects_without_points: usize,
    /// How much light finds its way out.
    pub closure: Closure,
    /// Exact sums of rows.
    pub row_sums: RowSums,
    /// Triangles that emit light.
    pub emitting: usize,
    /// Triangles that reflect light.
    pub reflecting: usize,
    /// Findings, the most severe first.
    pub findings: Vec<Finding>,
}

impl Audit {
    /// How many findings have a severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|f| f.severity == severity).count()
    }
}

/// What the parts of the audit work with.
struct Surveyed<'a> {
    scene: &'a Scene,
    parts: &'a Parts,
    /// Mean exitance of each triangle, W/m^2: the largest channel.
    exitance: &'a [f64],
    looker: &'a Looker<'a>,
    points: Vec<Point>,
    /// Rays from each point.
    rays: u32,
    /// What each point's rays met.
    looks: Vec<Look>,
}

impl Surveyed<'_> {
    /// An object in words.
    fn object(&self, object: u32) -> String {
        let name = self.scene.objects.get(object as usize).map_or("", |o| &o.name);
        format!("object \"{name}\"")
    }

    /// The object of a part in words.
    fn object_of(&self, part: u32) -> String {
        self.object(self.parts.objects[part as usize])
    }

    /// Each point with what it met.
    fn each(&self) -> impl Iterator<Item = (&Point, &Look)> {
        self.points.iter().zip(&self.looks)
    }

    /// Count of rays as a share of those of a point.
    fn share(&self, rays: u32) -> f64 {
        f64::from(rays) / f64::from(self.rays)
    }
}

/// Audits a scene as [`scene::read`] leaves it; `notices` are those of its notices that shall be
/// among the findings.
///
/// # Errors
///
/// Those of [`crate::mesh::build`], and of the monitor.
pub fn audit(scene: &Scene, notices: &[Notice], monitor: &Monitor) -> Result<Audit> {
    let whole_face = [DVec3::X, DVec3::Y, DVec3::Z];
    let of_all = |quantity: fn(&Scene, usize, &[DVec3; 3]) -> DVec3| -> Vec<f64> {
        let all = 0..scene.triangles.len();
        all.into_par_iter().map(|i| quantity(scene, i, &whole_face).max_element()).collect()
    };
    let exitance = of_all(scene::exitance);
    let reflects: Vec<bool> = of_all(scene::reflectance).into_iter().map(|r| r > 0.0).collect();
    let parts = Parts::find(scene);
    let points = points::spread(scene, &parts, &exitance);
    let rays = points::rays_from_each(points.len());
    let looker = Looker::new(scene, &parts, &reflects);
    let looks = looker.look(&points, rays, monitor)?;
    let survey = Surveyed {
        scene,
        parts: &parts,
        exitance: &exitance,
        looker: &looker,
        points,
        rays,
        looks,
    };

    let mut findings = reading::of_notices(notices);
    findings.extend(reading::of_geometry(&survey));
    let (turned, own) = turned::find(&survey, monitor)?;
    findings.extend(own);
    findings.extend(buried::find(&survey, &turned, monitor)?);
    findings.extend(emitters::find(&survey, &turned, &reflects));
    let (closure, own) = closure::find(&survey, &turned);
    findings.extend(own);
    let (row_sums, contacts, own) = row_sums::find(&survey, monitor)?;
    findings.extend(own);
    findings.extend(reading::of_contacts(contacts));
    // Stable: findings of one severity and kind stay in their order.
    findings.sort_by_key(|f| (f.severity, f.kind));
    let count = |list: &[bool]| list.iter().filter(|&&yes| yes).count();
    Ok(Audit {
        points: survey.points.len(),
        rays,
        objects_without_points: points::objects_without(scene, &survey.points),
        closure,
        row_sums,
        emitting: survey.exitance.iter().filter(|&&e| e > 0.0).count(),
        reflecting: count(&reflects),
        findings,
    })
}
