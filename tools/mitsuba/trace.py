"""Irradiance and radiance by path tracing, to be compared with lumel's to the last digit.

Mitsuba does the work: rays, meshes, diffuse reflection, emitters and their sampling. The loop
around it is this file's own, for one reason. In float32, Mitsuba's `path` starts each ray
8.9e-5 (1 + |p|) above the surface and ends each shadow ray at 0.9991 of its length: what is nearer
than that does not block, which brightens penumbrae. Here rays start NEAR times the scene's size above
the surface, and shadow rays end as far before their target: fifty times less, and still thirty times
the rounding of a position. What is left of it, `offset_bias` in tools/mitsuba/references.py measures
by making NEAR ten times larger.

Everything else is unbiased: emitters are sampled at every vertex, and weighed against rays that
hit them (balance heuristic); paths end by Russian roulette alone.
"""

from scene import dr, mi, np

# Distance of rays from surfaces, relative to the scene's size.
NEAR = 2e-6

# Reflections after which paths may end by Russian roulette.
CERTAIN = 3

# Paths in flight: about 200 bytes each.
BATCH = 1 << 21


@dr.syntax
def reflected(scene, near, position, normal, reflectance, sampler, active):
    """One sample a lane of the radiance that a surface reflects; `near` in metres."""
    position, normal = mi.Point3f(position), mi.Normal3f(normal)
    weight, active = mi.Color3f(reflectance), mi.Bool(active)
    result = mi.Color3f(0)
    depth = mi.UInt32(0)
    while active:
        frame = mi.Frame3f(normal)
        start = position + near * normal
        at = dr.zeros(mi.SurfaceInteraction3f)
        at.p, at.n = start, normal

        # Light of the emitters, from here.
        sample, light = scene.sample_emitter_direction(at, sampler.next_2d(), False, active)
        cosine = dr.dot(normal, sample.d)
        lit = active & (cosine > 0) & (sample.pdf > 0) & (dr.max(light) > 0)
        free = mi.Ray3f(start, sample.d, sample.dist - near, 0, [])
        lit &= ~scene.ray_test(free, lit)
        density = cosine / dr.pi
        # The weight of this way is pdf / (pdf + density), and `light` is divided by pdf.
        balance = sample.pdf / (sample.pdf + density)
        result += dr.select(lit, weight * light * density * balance, 0)

        # A ray of cosine density: its weight is the reflectance, which is in `weight`.
        local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        density = local.z / dr.pi
        ray = mi.Ray3f(start, frame.to_world(local))
        hit = scene.ray_intersect(ray, active)
        active &= hit.is_valid()
        emitter = hit.emitter(scene)
        emitted = emitter.eval(hit, active)
        bright = active & (dr.max(emitted) > 0)
        back = mi.DirectionSample3f(scene, hit, at)
        pdf = scene.pdf_emitter_direction(at, back, bright)
        result += dr.select(bright, weight * emitted * density / (density + pdf), 0)

        position, normal = mi.Point3f(hit.p), facing(hit)
        weight *= reflectance_at(hit, active)
        depth += 1
        survival = dr.select(depth >= CERTAIN, dr.minimum(dr.max(weight), 0.95), 1)
        active &= sampler.next_1d() < survival
        weight /= dr.maximum(survival, 1e-30)
        active &= dr.max(weight) > 0
    return result


def facing(hit):
    """The normal on the side that a ray came from."""
    return mi.Normal3f(dr.select(dr.dot(hit.n, hit.to_world(hit.wi)) > 0, hit.n, -hit.n))


def reflectance_at(hit, active):
    """Diffuse reflectance on the side that a ray came from: zero at the back of one-sided ones."""
    straight = mi.Vector3f(0, 0, dr.sign(hit.wi.z))
    return dr.pi * hit.bsdf().eval(mi.BSDFContext(), hit, straight, active)


def seen(scene, near, ray, sampler):
    """One sample a lane of the radiance along rays."""
    hit = scene.ray_intersect(ray)
    found = hit.is_valid()
    emitted = hit.emitter(scene).eval(hit, found)
    reflectance = reflectance_at(hit, found)
    more = found & (dr.max(reflectance) > 0)
    return emitted + reflected(scene, near, hit.p, facing(hit), reflectance, sampler, more)


def means(value, places, samples, seed, batch=BATCH):
    """Mean and standard error at each of `places` of `samples` values of `value(place, sampler)`.

    `value` is given UInt32 indices of places and a sampler, and returns colours. The samples of a
    batch are summed in float32 around the mean of the first batch, so that no digits are lost.
    """
    each = max(1, min(samples, batch // places))
    total, squares, around, done, run = 0.0, 0.0, None, 0, 0
    while done < samples:
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed * 100_003 + run, places * each)
        index = dr.arange(mi.UInt32, places * each) // each
        colours = value(index, sampler)
        dr.eval(colours)
        values = np.array(colours, dtype=np.float32).reshape(3, places, each)
        if around is None:
            around = values.mean(axis=2, dtype=np.float64)
        off = values - around[:, :, None]
        total += off.sum(axis=2)
        squares += (off**2).sum(axis=2)
        done += each
        run += 1
    mean = total / done
    variance = np.maximum(squares / done - mean**2, 0) * done / max(done - 1, 1)
    return (around + mean).T, np.sqrt(variance / done).T, done


def irradiance(scene, extent, positions, normals, samples, seed, near=NEAR):
    """Irradiance, W/m^2, and its standard error at points: arrays (points, 3); samples taken."""
    p, n = (mi.Point3f(np.ascontiguousarray(v.T, dtype=np.float32)) for v in (positions, normals))

    def value(index, sampler):
        position, normal = dr.gather(mi.Point3f, p, index), dr.gather(mi.Normal3f, mi.Normal3f(n), index)
        white = mi.Color3f(1)
        every = dr.full(mi.Bool, True, dr.width(index))
        return dr.pi * reflected(scene, near * extent, position, normal, white, sampler, every)

    return means(value, len(positions), samples, seed)


def picture(value, rays, across, samples, seed):
    """Means over across x across rays a pixel of `value(ray, sampler)`, and standard errors: arrays
    (pixels, 3); samples taken of each ray."""

    def one(index, sampler):
        ray = mi.Ray3f(dr.gather(mi.Point3f, rays.o, index), dr.gather(mi.Vector3f, rays.d, index))
        return value(ray, sampler)

    mean, error, done = means(one, dr.width(rays.d), samples, seed)
    mean = mean.reshape(-1, across**2, 3).mean(axis=1)
    error = np.sqrt((error.reshape(-1, across**2, 3) ** 2).sum(axis=1)) / across**2
    return mean, error, done


def radiance(scene, extent, rays, across, samples, seed, near=NEAR):
    """Radiance, W/(m^2 sr), of the pixels of a picture, as [`picture`] has it."""
    return picture(lambda ray, sampler: seen(scene, near * extent, ray, sampler),
                   rays, across, samples, seed)


def stock_path():
    """Mitsuba's own path tracer: paths of any length, ended by Russian roulette alone."""
    return mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": CERTAIN + 1})


def stock_irradiance(scene, positions, normals, reflectance, emitted, samples, seed, above=1e-4):
    """Irradiance at points of the surface by Mitsuba's own `path`, unchanged.

    A ray meets each point from `above` metres over it; what comes back is Le + rho / pi H.
    """
    integrator = stock_path()
    p, n = (mi.Point3f(np.ascontiguousarray(v.T, dtype=np.float32)) for v in (positions, normals))

    def value(index, sampler):
        position, normal = dr.gather(mi.Point3f, p, index), dr.gather(mi.Normal3f, mi.Normal3f(n), index)
        ray = mi.RayDifferential3f(mi.Ray3f(position + above * normal, -mi.Vector3f(normal)))
        return integrator.sample(scene, sampler, ray)[0]

    mean, error, done = means(value, len(positions), samples, seed)
    factor = np.pi / reflectance
    return (mean - emitted) * factor, error * factor, done
