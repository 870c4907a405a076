//! What solving a scene would take, found without solving it.

use lumel::Result;
use lumel::cluster::Clusters;
use lumel::mesh;
use lumel::operator::clustered::{self, Kept};
use lumel::operator::{FastOptions, Operator, OperatorKind, Stage};
use lumel::scene::Scene;
use lumel::solve::many::{self, is_many};
use lumel::solve::within::COARSEST;
use lumel::visibility::Occluders;
use serde::Serialize;

use super::settings::SolveSettings;
use super::table::bytes;

/// Elements and memory.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Elements of the mesh.
    pub elements: usize,
    /// Collocation nodes: unknowns of each channel.
    pub nodes: usize,
    /// Bytes of the operator, from samples; of the exact one an upper estimate.
    pub operator_bytes: u64,
    /// Bytes that may be used.
    pub max_memory: Option<u64>,
    /// Whether a render or a probe would begin.
    pub fits: bool,
}

impl Forecast {
    /// Builds the mesh and forecasts the operator.
    pub fn new(scene: &Scene, settings: &SolveSettings) -> Result<Forecast> {
        // To a tolerance the coarsest mesh is what must fit; finer ones follow while they do.
        let (mesh, operator) = match settings.tolerance {
            Some(tolerance) => (
                mesh::build_to_tolerance(scene, &COARSEST, tolerance)?,
                OperatorKind::Fast(FastOptions::new(1e-2, None, None)?),
            ),
            None => (mesh::build(scene, &settings.light_options().mesh)?, settings.operator),
        };
        let fits = |bytes| settings.max_memory.is_none_or(|allowed| bytes <= allowed);
        if let Some(tolerance) = settings.tolerance
            && is_many(mesh.roots.len(), tolerance)
        {
            let operator_bytes = many::forecast(scene, &mesh, tolerance)?;
            return Ok(Forecast {
                elements: mesh.elements(),
                nodes: mesh.nodes(),
                operator_bytes,
                max_memory: settings.max_memory,
                fits: fits(operator_bytes),
            });
        }
        let triangles: Vec<_> = scene.triangles.iter().map(|t| t.vertices).collect();
        let occluders = Occluders::build(&triangles);
        let clusters = Clusters::build(&mesh);
        let stage = Stage { mesh: &mesh, clusters: &clusters, occluders: &occluders };
        let mut operator_bytes = Operator::forecast(stage, operator);
        if let OperatorKind::Clustered(options) = operator
            && !fits(operator_bytes)
        {
            operator_bytes = clustered::forecast(stage, options.eta).bytes(Kept::Exact);
        }
        Ok(Forecast {
            elements: mesh.elements(),
            nodes: mesh.nodes(),
            operator_bytes,
            max_memory: settings.max_memory,
            fits: fits(operator_bytes),
        })
    }

    /// The memory in words.
    pub fn memory_text(&self) -> String {
        let needed = format!("about {}", bytes(self.operator_bytes));
        match self.max_memory {
            None => needed,
            Some(allowed) if self.fits => format!("{needed}; {} may be used", bytes(allowed)),
            Some(allowed) => format!(
                "{needed}, but only {} may be used: choose larger elements (--max-edge, \
                 --subdivide), --basis constant, or raise --max-memory",
                bytes(allowed)
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_comes_with_a_remedy() {
        let forecast = |max_memory, fits| Forecast {
            elements: 1,
            nodes: 3,
            operator_bytes: 3 << 20,
            max_memory,
            fits,
        };
        assert_eq!(forecast(None, true).memory_text(), "about 3 MiB");
        assert_eq!(forecast(Some(4 << 20), true).memory_text(), "about 3 MiB; 4 MiB may be used");
        let text = forecast(Some(2 << 20), false).memory_text();
        assert!(text.contains("only 2 MiB") && text.contains("--max-edge"), "{text}");
    }
}
