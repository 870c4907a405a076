//! Makes an atlas: what is kept and what is charted, how dense, on which page.

use std::collections::BTreeMap;

use glam::DVec2;

use super::atlas::{Atlas, AtlasOptions, Chart, DEFAULT_SIZE, Density, LARGEST_SIZE, Page};
use super::charts::Cutter;
use super::pack::{self, Item, Place};
use super::second_set::look;
use crate::error::{Error, Result};
use crate::geometry::polygon::twice_area;
use crate::scene::{Notice, Scene, name_fits};

/// Bytes that a texel takes until it is written: three values, and what is made of them.
const BYTES_A_TEXEL: u64 = 80;

/// Sides of pages whose size is free are multiples of this, as compressed textures want them.
const STEP: u32 = 4;

/// Names listed in a message.
const LISTED: usize = 30;

/// Gives every triangle of the scene that is to be baked a place on a page.
///
/// A second set of texture coordinates that can hold a lightmap ([`super::second_set`]) is kept:
/// as it is, on one page, where that of all objects together can; else each object that has one
/// gets its unit square as a part of a page. All others get charts (`charts`).
///
/// Charts have whole numbers of texels along both sides, at least one, and those that would be larger
/// than a page are made as large as one.
///
/// # Errors
///
/// [`Error::Usage`] for options that make no sense, names that nothing has and pages that are too
/// small; [`Error::Memory`] where pages would take more than they may.
pub fn make_atlas(scene: &Scene, options: &AtlasOptions) -> Result<Atlas> {
    check(options)?;
    let wanted = wanted(scene, &options.only)?;
    let relative = densities(scene, options)?;
    let mut notices = vec![];
    let members = members(scene, &wanted);
    let mut is_kept = vec![false; scene.objects.len()];
    if options.keep {
        let sets: Vec<bool> = members.iter().map(|m| look(scene, m).is_valid()).collect();
        if members.iter().zip(&sets).all(|(m, valid)| m.is_empty() || *valid) {
            let all: Vec<u32> = members.concat();
            if look(scene, &all).is_valid() {
                return kept_whole(scene, options, &members, &relative);
            }
        }
        is_kept = sets;
    }
    let mut regions: Vec<Region> = vec![];
    for (object, own) in members.iter().enumerate().filter(|(i, _)| is_kept[*i]) {
        regions.push(Region::kept(scene, object as u32, own, &relative));
    }
    let charted: Vec<bool> = wanted
        .iter()
        .zip(&scene.triangles)
        .map(|(w, t)| *w && !is_kept[t.object as usize])
        .collect();
    let groups = groups(&relative);
    for flat in Cutter::new(scene, &groups).charts(&charted) {
        let density = relative[flat.triangles[0] as usize];
        regions.push(Region {
            object: flat.object,
            density,
            size: flat.size,
            from: DVec2::ZERO,
            kept: false,
            triangles: flat.triangles,
            corners: flat.corners,
        });
    }
    // Stable: in order of the objects.
    regions.sort_by_key(|r| r.object);
    let layout = lay_out(&regions, options)?;
    let shrunk = layout.shrunk;
    let mut atlas = placed(scene, &regions, &layout, options.padding);
    if shrunk > 0 {
        notices.push(Notice {
            about: "lightmap".into(),
            text: "charts larger than a page made as large as one: they have fewer texels a metre \
                   (--max-size)"
                .into(),
            count: shrunk,
        });
    }
    atlas.notices = notices;
    Ok(atlas)
}

/// Something that gets a rectangle of texels: a chart, or an object's unit square.
struct Region {
    object: u32,
    /// Texels a metre, or a share of those.
    density: f64,
    /// Extent in units of `corners`: metres, or for kept ones lengths in the unit square that are
    /// scaled to metres.
    size: DVec2,
    /// Where it begins; only kept ones begin elsewhere than at zero.
    from: DVec2,
    kept: bool,
    triangles: Vec<u32>,
    corners: Vec<[DVec2; 3]>,
}

impl Region {
    /// The second set of an object, scaled so that its area is that of the surface.
    fn kept(scene: &Scene, object: u32, triangles: &[u32], relative: &[f64]) -> Region {
        let uv = |i: &u32| scene.triangles[*i as usize].uv[1];
        let scale = scale_of(scene, triangles);
        let corners: Vec<[DVec2; 3]> = triangles.iter().map(|i| uv(i).map(|x| scale * x)).collect();
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for x in corners.iter().flatten() {
            (low, high) = (low.min(*x), high.max(*x));
        }
        let density = triangles.iter().map(|&i| relative[i as usize]).fold(0.0, f64::max);
        Region {
            object,
            density,
            size: high - low,
            from: low,
            kept: true,
            triangles: triangles.to_vec(),
            corners,
        }
    }
}

/// Metres a unit of the second set of texture coordinates: the root of the ratio of the areas.
fn scale_of(scene: &Scene, triangles: &[u32]) -> f64 {
    let (mut real, mut laid) = (0.0, 0.0);
    for &i in triangles {
        let triangle = &scene.triangles[i as usize];
        real += triangle.normal_and_area().1;
        laid += 0.5 * twice_area(&triangle.uv[1]).abs();
    }
    // Areas of surfaces of 1e-160 m are zero.
    (real / laid).sqrt().max(f64::MIN_POSITIVE)
}

fn check(options: &AtlasOptions) -> Result<()> {
    let refuse = |text: String| Err(Error::Usage(text));
    let is_density = |d: f64| d.is_finite() && d > 0.0;
    let given = options.texels_per_metre.into_iter();
    for density in given.chain(options.densities.iter().map(|d| d.texels_per_metre)) {
        if !is_density(density) {
            return refuse(format!("texels a metre must be greater than zero, not {density}"));
        }
    }
    for (name, side) in [("--size", options.size), ("--max-size", Some(options.max_size))] {
        if let Some(side) = side
            && !(1..=LARGEST_SIZE).contains(&side)
        {
            return refuse(format!("{name} must be between 1 and {LARGEST_SIZE}, not {side}"));
        }
    }
    let side = options.size.unwrap_or(options.max_size);
    if u64::from(side) <= 2 * u64::from(options.padding) {
        return refuse(format!(
            "a page of {side} x {side} texels has no room for charts with {} texels of padding on \
             each side: choose a larger page or less padding",
            options.padding
        ));
    }
    Ok(())
}

/// Of every triangle whether the name of its object or of its material fits one of `only`; all where
/// there are none.
///
/// # Errors
///
/// [`Error::Usage`] for a name that nothing has.
pub fn wanted(scene: &Scene, only: &[String]) -> Result<Vec<bool>> {
    if only.is_empty() {
        return Ok(vec![true; scene.triangles.len()]);
    }
    let mut wanted = vec![false; scene.triangles.len()];
    for pattern in only {
        let hit = fitting(scene, pattern, "--only")?;
        wanted.iter_mut().zip(hit).for_each(|(w, hit)| *w |= hit);
    }
    Ok(wanted)
}

/// Texels a metre of each triangle; relative to 1 where none are given for all.
fn densities(scene: &Scene, options: &AtlasOptions) -> Result<Vec<f64>> {
    let base = options.texels_per_metre.unwrap_or(1.0);
    let mut densities = vec![base; scene.triangles.len()];
    for Density { pattern, texels_per_metre } in &options.densities {
        let hit = fitting(scene, pattern, "--texels-per-metre")?;
        for (density, _) in densities.iter_mut().zip(hit).filter(|(_, hit)| *hit) {
            *density = *texels_per_metre;
        }
    }
    Ok(densities)
}

/// Which triangles have an object or a material of a name.
fn fitting(scene: &Scene, pattern: &str, option: &str) -> Result<Vec<bool>> {
    let objects: Vec<bool> = scene.objects.iter().map(|o| name_fits(pattern, &o.name)).collect();
    let materials: Vec<bool> =
        scene.materials.iter().map(|m| name_fits(pattern, &m.name)).collect();
    let hit: Vec<bool> = scene
        .triangles
        .iter()
        .map(|t| objects[t.object as usize] || materials[t.material as usize])
        .collect();
    if hit.contains(&true) {
        return Ok(hit);
    }
    let names =
        scene.objects.iter().map(|o| &o.name).chain(scene.materials.iter().map(|m| &m.name));
    let count = scene.objects.len() + scene.materials.len();
    let mut list: Vec<String> = names.take(LISTED).map(|n| format!("\"{n}\"")).collect();
    if count > LISTED {
        list.push(format!("and {} more", count - LISTED));
    }
    Err(Error::Usage(format!(
        "{option} {pattern}: no object or material of this name has a face in {}, which has: {}",
        scene.path.display(),
        list.join(", ")
    )))
}

/// The wanted triangles of each object.
fn members(scene: &Scene, wanted: &[bool]) -> Vec<Vec<u32>> {
    let mut members = vec![vec![]; scene.objects.len()];
    for (i, triangle) in scene.triangles.iter().enumerate().filter(|(i, _)| wanted[*i]) {
        members[triangle.object as usize].push(i as u32);
    }
    members
}

/// A number for each density: charts have one.
fn groups(densities: &[f64]) -> Vec<u32> {
    let mut numbers = BTreeMap::new();
    densities
        .iter()
        .map(|d| {
            let next = numbers.len() as u32;
            *numbers.entry(d.to_bits()).or_insert(next)
        })
        .collect()
}

/// One page that is the unit square of the file's own second set.
fn kept_whole(
    scene: &Scene,
    options: &AtlasOptions,
    members: &[Vec<u32>],
    relative: &[f64],
) -> Result<Atlas> {
    let all = members.concat();
    let scale = scale_of(scene, &all);
    let mut notices = vec![];
    let side = match (options.size, options.texels_per_metre) {
        (Some(size), _) => size,
        (None, None) => DEFAULT_SIZE.min(options.max_size),
        (None, Some(density)) => {
            let side = scale * density;
            if side > f64::from(options.max_size) {
                notices.push(Notice {
                    about: "lightmap".into(),
                    text: "the second set of texture coordinates fills one page: it has fewer \
                           texels a metre than asked for (--max-size)"
                        .into(),
                    count: 1,
                });
            }
            // Saturates; at least one step.
            (((side / f64::from(STEP)).ceil().max(1.0) as u32).saturating_mul(STEP))
                .min(options.max_size)
        }
    };
    if all.iter().any(|&i| relative[i as usize] != relative[all[0] as usize]) {
        notices.push(Notice {
            about: "lightmap".into(),
            text: "the second set of texture coordinates is kept as it is: texels a metre of \
                   single objects or materials have no effect"
                .into(),
            count: 1,
        });
    }
    within_memory(f64::from(side) * f64::from(side), options)?;
    let mut atlas = Atlas {
        pages: vec![Page { width: side, height: side }],
        page: vec![None; scene.triangles.len()],
        uv: vec![[DVec2::ZERO; 3]; scene.triangles.len()],
        charts: vec![],
        notices,
    };
    for (object, own) in members.iter().enumerate().filter(|(_, own)| !own.is_empty()) {
        let (mut low, mut high) = (DVec2::ONE, DVec2::ZERO);
        for &i in own {
            let uv = scene.triangles[i as usize].uv[1].map(|x| x.clamp(DVec2::ZERO, DVec2::ONE));
            uv.iter().for_each(|x| (low, high) = (low.min(*x), high.max(*x)));
            atlas.page[i as usize] = Some(0);
            atlas.uv[i as usize] = uv;
        }
        let from = (low * f64::from(side)).floor().as_uvec2();
        let to = (high * f64::from(side)).ceil().as_uvec2();
        atlas.charts.push(Chart {
            object: object as u32,
            page: 0,
            rectangle: [from.x, from.y, to.x - from.x, to.y - from.y],
            density: f64::from(side) / scale_of(scene, own),
            kept: true,
            triangles: own.clone(),
        });
    }
    Ok(atlas)
}

/// Rectangles on pages.
struct Layout {
    pages: Vec<Page>,
    /// Of each region its rectangle without padding, before turning, and where that is.
    rectangles: Vec<Rectangle>,
    places: Vec<Place>,
    /// How many regions were made smaller to fit a page.
    shrunk: usize,
}

/// A region in texels.
#[derive(Clone, Copy)]
struct Rectangle {
    width: u32,
    height: u32,
    /// Texels a unit of the region's corners, along both axes.
    scale: DVec2,
    /// The region's corners times `scale` less this are texels of the rectangle.
    from: DVec2,
    /// Whether it may be turned by a quarter: kept ones may not.
    may_turn: bool,
    shrunk: bool,
}

/// Bisections of the density that fits a page: to 1 part in 1000 from a range of 2^20.
const BISECTIONS: u32 = 24;

fn lay_out(regions: &[Region], options: &AtlasOptions) -> Result<Layout> {
    if regions.is_empty() {
        return Err(Error::Usage("no face is left that could be baked: see --only".into()));
    }
    let page = options.size.unwrap_or(options.max_size);
    match (options.texels_per_metre, options.size) {
        (Some(_), _) => {
            let rectangles = rectangles(regions, 1.0, page, options)?;
            if let Some(size) = options.size {
                return several(rectangles, size, true, options);
            }
            match smallest(&rectangles, options) {
                Some(layout) => Ok(layout),
                None => several(rectangles, page, false, options),
            }
        }
        (None, size) => {
            fitted(regions, size.unwrap_or(DEFAULT_SIZE.min(options.max_size)), options)
        }
    }
}

/// Everything on one page of a given size, as dense as fits.
fn fitted(regions: &[Region], size: u32, options: &AtlasOptions) -> Result<Layout> {
    within_memory(f64::from(size) * f64::from(size), options)?;
    let area: f64 = regions.iter().map(|r| r.density * r.density * r.size.x * r.size.y).sum();
    let longest = regions.iter().map(|r| r.density * r.size.max_element()).fold(0.0, f64::max);
    let most = (f64::from(size) / area.sqrt()).min(f64::from(size - 2 * options.padding) / longest);
    let attempt = |scale: f64| {
        let rectangles = rectangles(regions, scale, size, options).ok()?;
        if rectangles.iter().any(|r| r.shrunk) {
            return None;
        }
        let items = items(&rectangles, options.padding);
        pack::one_page(size, size, &items).map(|places| (rectangles, places))
    };
    // By powers of two down to what fits, then between.
    let mut best = None;
    let (mut low, mut high) = (most, most);
    for _ in 0..BISECTIONS {
        best = attempt(low);
        if best.is_some() {
            break;
        }
        (low, high) = (0.5 * low, low);
    }
    if best.is_none() {
        return Err(Error::Usage(format!(
            "{} charts do not fit one page of {size} x {size} texels with {} texels of padding on \
             each side: choose a larger --size, less padding, or --texels-per-metre for several \
             pages",
            regions.len(),
            options.padding
        )));
    }
    while high > 1.001 * low {
        let middle = (low * high).sqrt();
        match attempt(middle) {
            Some(found) => (best, low) = (Some(found), middle),
            None => high = middle,
        }
    }
    let (rectangles, places) = best.unwrap_or_default();
    Ok(Layout { pages: vec![Page { width: size, height: size }], rectangles, places, shrunk: 0 })
}

/// The smallest square page that holds everything; `None` where none up to the largest does.
fn smallest(rectangles: &[Rectangle], options: &AtlasOptions) -> Option<Layout> {
    let items = items(rectangles, options.padding);
    let largest = options.max_size;
    let mut best = (largest, pack::one_page(largest, largest, &items)?);
    let area: f64 = items.iter().map(|i| f64::from(i.width) * f64::from(i.height)).sum();
    let longest = items.iter().map(|i| i.width.max(i.height)).max().unwrap_or(1);
    let side_of = |steps: u32| steps.saturating_mul(STEP).min(largest);
    let mut low = (area.sqrt() as u32).max(longest) / STEP;
    let mut high = largest.div_ceil(STEP);
    while low + 1 < high {
        let middle = low + (high - low) / 2;
        match pack::one_page(side_of(middle), side_of(middle), &items) {
            Some(places) => (best, high) = ((side_of(middle), places), middle),
            None => low = middle,
        }
    }
    let (side, places) = best;
    let shrunk = rectangles.iter().filter(|r| r.shrunk).count();
    let mut layout = Layout {
        pages: vec![Page { width: side, height: side }],
        rectangles: rectangles.to_vec(),
        places,
        shrunk,
    };
    layout.crop(options.padding);
    Some(layout)
}

/// As many pages as it takes.
fn several(
    rectangles: Vec<Rectangle>,
    size: u32,
    exact: bool,
    options: &AtlasOptions,
) -> Result<Layout> {
    let (places, count) = pack::pages(size, size, &items(&rectangles, options.padding));
    within_memory(f64::from(count) * f64::from(size) * f64::from(size), options)?;
    let shrunk = rectangles.iter().filter(|r| r.shrunk).count();
    let pages = vec![Page { width: size, height: size }; count as usize];
    let mut layout = Layout { pages, rectangles, places, shrunk };
    if !exact {
        layout.crop(options.padding);
    }
    Ok(layout)
}

impl Layout {
    /// Cuts away the rows below the last rectangle of each page.
    fn crop(&mut self, padding: u32) {
        let mut last = vec![1; self.pages.len()];
        for (rectangle, place) in self.rectangles.iter().zip(&self.places) {
            let height = if place.turned { rectangle.width } else { rectangle.height };
            let end = &mut last[place.page as usize];
            *end = (*end).max(place.y + height + 2 * padding);
        }
        for (page, end) in self.pages.iter_mut().zip(last) {
            page.height = end.next_multiple_of(STEP).min(page.height);
        }
    }
}

/// All regions in texels, `scale` times as dense as they say.
fn rectangles(
    regions: &[Region],
    scale: f64,
    page: u32,
    options: &AtlasOptions,
) -> Result<Vec<Rectangle>> {
    let most = page - 2 * options.padding;
    let rectangles: Vec<Rectangle> =
        regions.iter().map(|r| rectangle(r, scale * r.density, most)).collect();
    let texels = rectangles.iter().map(|r| f64::from(r.width) * f64::from(r.height)).sum();
    within_memory(texels, options)?;
    Ok(rectangles)
}

fn rectangle(region: &Region, density: f64, most: u32) -> Rectangle {
    let limit = f64::from(most);
    let longest = region.size.max_element();
    if region.kept {
        let shrunk = density * longest > (limit - 1.0).max(0.5);
        // Its own grid of texels begins at its zero: shifted by whole texels only.
        let scale = if shrunk { (limit - 1.0).max(0.5) / longest } else { density };
        let from = (scale * region.from).floor();
        let size = (scale * (region.from + region.size)).ceil() - from;
        let [width, height] = size.to_array().map(|s| (s as u32).clamp(1, most));
        let scale = DVec2::splat(scale);
        return Rectangle { width, height, scale, from, may_turn: false, shrunk };
    }
    let shrunk = density * longest > limit;
    let density = if shrunk { limit / longest } else { density };
    let side = |length: f64| (density * length).round().clamp(1.0, limit);
    let size = DVec2::new(side(region.size.x), side(region.size.y));
    let [width, height] = size.to_array().map(|s| s as u32);
    let (scale, from) = (size / region.size, DVec2::ZERO);
    Rectangle { width, height, scale, from, may_turn: true, shrunk }
}

fn items(rectangles: &[Rectangle], padding: u32) -> Vec<Item> {
    let item = |r: &Rectangle| Item {
        width: r.width + 2 * padding,
        height: r.height + 2 * padding,
        may_turn: r.may_turn,
    };
    rectangles.iter().map(item).collect()
}

fn within_memory(texels: f64, options: &AtlasOptions) -> Result<()> {
    let needed = texels * BYTES_A_TEXEL as f64;
    if needed <= options.max_memory as f64 {
        return Ok(());
    }
    Err(Error::Memory {
        what: format!("a lightmap of {texels:.2e} texels"),
        needed: needed as u64,
        allowed: options.max_memory,
        remedy: "choose fewer --texels-per-metre, a smaller --size, or raise --max-memory".into(),
    })
}

/// The atlas of a layout.
fn placed(scene: &Scene, regions: &[Region], layout: &Layout, padding: u32) -> Atlas {
    let mut atlas = Atlas {
        pages: layout.pages.clone(),
        page: vec![None; scene.triangles.len()],
        uv: vec![[DVec2::ZERO; 3]; scene.triangles.len()],
        charts: Vec::with_capacity(regions.len()),
        notices: vec![],
    };
    for ((region, rectangle), place) in regions.iter().zip(&layout.rectangles).zip(&layout.places) {
        let page = atlas.pages[place.page as usize];
        let texels = DVec2::new(f64::from(page.width), f64::from(page.height));
        let corner = DVec2::new(f64::from(place.x + padding), f64::from(place.y + padding));
        let (mut width, mut height) = (rectangle.width, rectangle.height);
        let size = DVec2::new(f64::from(width), f64::from(height));
        let own = |x: DVec2| (rectangle.scale * x - rectangle.from).clamp(DVec2::ZERO, size);
        // Charts have y upward, pages downward.
        let place_of = |x: DVec2| match (region.kept, place.turned) {
            (true, _) => own(x),
            (false, false) => DVec2::new(own(x).x, size.y - own(x).y),
            (false, true) => DVec2::new(own(x).y, own(x).x),
        };
        for (&i, corners) in region.triangles.iter().zip(&region.corners) {
            atlas.page[i as usize] = Some(place.page);
            atlas.uv[i as usize] = corners.map(|x| (corner + place_of(x)) / texels);
        }
        if place.turned {
            (width, height) = (height, width);
        }
        atlas.charts.push(Chart {
            object: region.object,
            page: place.page,
            rectangle: [place.x + padding, place.y + padding, width, height],
            density: (rectangle.scale.x * rectangle.scale.y).sqrt(),
            kept: region.kept,
            triangles: region.triangles.clone(),
        });
    }
    atlas
}
