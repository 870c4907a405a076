//! What was typed for `lumel bake`, checked.

use std::path::PathBuf;

use lumel::bake::atlas::{AtlasOptions, DEFAULT_SIZE, Density};
use lumel::bake::files::{self, Format};
use lumel::bake::target::Target;
use lumel::{Error, Result};

use super::args::{BakeArgs, FormatArg, TargetArg, ToArg};
use super::settings::{
    Described, RunSettings, SceneSettings, SolveSettings, pair, run, scene, solve,
};

/// Sides of pages are not made smaller than this.
const LEAST_SIZE: u32 = 16;

/// `lumel bake`.
#[derive(Clone, Debug)]
pub struct BakeSettings {
    /// The scene.
    pub scene: SceneSettings,
    /// The scene to write.
    pub output: PathBuf,
    /// Where the light goes.
    pub to: ToArg,
    /// Who shows it.
    pub target: Target,
    /// How lightmaps are laid out.
    pub atlas: AtlasOptions,
    /// How they are stored.
    pub format: Format,
    /// Whether layers are stored.
    pub layers: bool,
    /// Stops, where they are fixed.
    pub exposure_ev: Option<f64>,
    /// Most triangles with light at vertices.
    pub most_triangles: usize,
    /// How to solve.
    pub solve: SolveSettings,
    /// How to run.
    pub run: RunSettings,
}

impl BakeSettings {
    /// Checks what was typed.
    pub fn new(args: BakeArgs) -> Result<Self> {
        files::is_binary(&args.output)?;
        let bake = args.bake;
        let usage = |text: &str| Err(Error::Usage(text.into()));
        if bake.half && bake.format != FormatArg::Exr {
            return usage("--half is for .exr files: use --format exr");
        }
        if bake.layers && bake.format != FormatArg::Exr {
            return usage("--layers need .exr files: use --format exr");
        }
        if bake.size.is_some_and(|size| size > bake.max_size) {
            return usage("--size is larger than --max-size: raise --max-size");
        }
        let target = match bake.target {
            TargetArg::Unlit => Target::Unlit,
            TargetArg::Three => Target::Three,
            TargetArg::Bevy => Target::Bevy,
            TargetArg::Blender => Target::Blender,
        };
        if bake.to == ToArg::Vertices {
            if target != Target::Unlit {
                return usage(
                    "--to vertices writes radiance in unlit materials, whatever shows it: leave out \
                     --target",
                );
            }
            if bake.layers {
                return usage("--layers are of lightmaps: leave out --to vertices, or --layers");
            }
        }
        let solve = solve(&args.solve)?;
        if bake.layers && solve.tolerance.is_none() {
            return usage(
                "--layers need a solution that tells direct light apart: use --tolerance, and leave \
                 out options that set elements and operator by hand",
            );
        }
        let densities = bake
            .density
            .into_iter()
            .map(|(pattern, texels_per_metre)| Density { pattern, texels_per_metre })
            .collect();
        Ok(BakeSettings {
            scene: scene(args.scene, &solve),
            output: args.output,
            to: bake.to,
            target,
            atlas: AtlasOptions {
                texels_per_metre: bake.texels_per_metre,
                size: bake.size,
                max_size: bake.max_size,
                padding: bake.padding,
                only: bake.only,
                densities,
                keep: !bake.new_coordinates,
                max_memory: solve.max_memory.unwrap_or(u64::MAX),
            },
            format: match bake.format {
                FormatArg::Exr => Format::Exr { half: bake.half },
                FormatArg::Hdr => Format::Hdr,
                FormatArg::Png => Format::Png,
            },
            layers: bake.layers,
            exposure_ev: bake.exposure,
            most_triangles: bake.max_triangles as usize,
            solve,
            run: run(args.run),
        })
    }

    /// The same with fewer texels, by this factor in each direction, or triangles as they are.
    pub fn coarse(&self, coarser: u32) -> BakeSettings {
        let mut coarse = self.clone();
        let atlas = &mut coarse.atlas;
        match &mut atlas.texels_per_metre {
            // Densities of some objects are absolute beside it, and relative without it.
            Some(texels) => {
                let coarser = f64::from(coarser);
                *texels /= coarser;
                atlas.densities.iter_mut().for_each(|d| d.texels_per_metre /= coarser);
            }
            None => {
                let size = atlas.size.unwrap_or(DEFAULT_SIZE).min(atlas.max_size);
                atlas.size = Some((size / coarser).max(LEAST_SIZE.min(size)));
            }
        }
        coarse.most_triangles = 0;
        coarse
    }

    /// For the files.
    pub fn metadata(&self) -> Described {
        let mut list = self.scene.metadata();
        list.extend(self.solve.metadata());
        if !self.atlas.only.is_empty() {
            list.push(pair("only", self.atlas.only.join(" ")));
        }
        if self.to == ToArg::Vertices {
            list.push(pair("max-triangles", self.most_triangles));
            return list;
        }
        let atlas = &self.atlas;
        list.extend(atlas.texels_per_metre.map(|n| pair("texels-per-metre", n)));
        list.extend(atlas.size.map(|n| pair("size", n)));
        list.push(pair("max-size", atlas.max_size));
        list.push(pair("padding", atlas.padding));
        let texts = atlas.densities.iter().map(|d| format!("{}={}", d.pattern, d.texels_per_metre));
        let texts: Vec<String> = texts.collect();
        if !texts.is_empty() {
            list.push(pair("density", texts.join(" ")));
        }
        if !atlas.keep {
            list.push(pair("new-coordinates", true));
        }
        list
    }

    /// For the report.
    pub fn described(&self) -> Described {
        let mut list = self.metadata();
        list.push(pair("output", self.output.display()));
        list.push(pair("target", self.target.name()));
        list.push(pair("format", self.format.extension()));
        list.extend(self.exposure_ev.map(|ev| pair("exposure", ev)));
        list.extend(self.solve.described());
        list.extend(self.run.described());
        list
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::{Cli, Command};
    use clap::Parser;

    fn bake(typed: &str) -> Result<BakeSettings> {
        let words = "lumel bake s.gltf".split(' ').chain(typed.split_whitespace());
        match Cli::try_parse_from(words).unwrap().command {
            Command::Bake(args) => BakeSettings::new(args),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn options_that_do_not_fit_are_usage_errors() {
        for typed in [
            "-o a.obj",
            "-o a",
            "-o a.glb --half --format png",
            "-o a.glb --layers --format hdr",
            "-o a.glb --layers --subdivide 2",
            "-o a.glb --to vertices --target three",
            "-o a.glb --to vertices --layers",
            "-o a.glb --size 512 --max-size 256",
        ] {
            assert_eq!(bake(typed).unwrap_err().exit_code(), 2, "{typed}");
        }
        let good = bake("-o a.GLB --target bevy --half --layers --density F=3 --size 64").unwrap();
        assert_eq!((good.target, good.format), (Target::Bevy, Format::Exr { half: true }));
        assert_eq!(good.atlas.densities[0].texels_per_metre, 3.0);
    }

    #[test]
    fn coarse_settings_have_an_eighth_of_the_texels_each_way() {
        let coarse = |typed: &str| bake(&format!("-o a.glb {typed}")).unwrap().coarse(8).atlas;
        assert_eq!(coarse("--size 8").size, Some(8));
        assert_eq!(coarse("").size, Some(128));
        assert_eq!(coarse("--size 512").size, Some(64));
        assert_eq!(coarse("--size 20 --density F=3").size, Some(16));
        let dense = coarse("--texels-per-metre 80 --density F=16");
        assert_eq!((dense.texels_per_metre, dense.size), (Some(10.0), None));
        assert_eq!(dense.densities[0].texels_per_metre, 2.0);
        assert_eq!(coarse("--density F=16").densities[0].texels_per_metre, 16.0);
    }

    #[test]
    fn where_it_goes_and_how_long_it_may_take_change_no_file() {
        let one = bake("-o a.glb --only W* --padding 3").unwrap();
        let other =
            bake("-o b.gltf --only W* --padding 3 --threads 2 --quiet --time-limit 5").unwrap();
        assert_eq!(one.metadata(), other.metadata());
    }
}
