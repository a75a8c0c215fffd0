"""Noise in space and time: smooth random fields with exact derivatives, in the kernel language.

Gradient noise on the cubic lattice (Perlin, Improving noise, SIGGRAPH 2002: quintic fade, so that
fields have continuous second derivatives). Instead of a permutation table each lattice point
hashes its own coordinates: nothing is gathered from memory, and nothing repeats within 2^32 cells.

Time is not a fourth lattice dimension, which would double the corners, nor a rotation of the
gradients, which returns to where it was. A lattice point's random vector moves from one random
vector to the next, once in a unit of time; each point does so at a phase of its own, so that the
field never rests everywhere at once, and the corners stay eight. The loop over the corners has a
fixed length, so that the compiler runs the eight side by side.

All fields have mean 0 and root mean square 1 over space and time.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from motes.kernel import floor, int32, kernel, real, sqrt, uint32

LACUNARITY = 2.0
"""Ratio of the sizes of two successive octaves."""

OCTAVE_SHIFT = 0.381966
"""Displacement of each octave, so that their lattices do not share points."""

NOISE_SCALE = 5.916457062675093
"""One over the root mean square of the bare gradient noise."""

CURL_SCALE = 1.867845176932815
"""One over the root mean square length of the bare curl."""


@kernel
def chained(h, i):
    """Hash of a hash and one more number, light: one multiplication."""
    h = uint32(uint32(h ^ i) * uint32(0x9E3779B1))
    return uint32(h ^ (h >> uint32(15)))


@kernel
def mixed(h):
    """Bijection of 32-bit numbers that changes half the bits for each bit that changes."""
    h = uint32(uint32(h ^ (h >> uint32(16))) * uint32(0x7FEB352D))
    h = uint32(uint32(h ^ (h >> uint32(15))) * uint32(0x846CA68B))
    return uint32(h ^ (h >> uint32(16)))


@kernel
def fade(u):
    """6 u^5 - 15 u^4 + 10 u^3 and its derivative."""
    rest = u * (u - 1.0)
    return u * u * u * (u * (u * 6.0 - 15.0) + 10.0), 30.0 * rest * rest


@kernel
def vector(h):
    """Three numbers, uniform in (-1, 1), from ten bits each."""
    x = real(int32(h >> uint32(22)))
    y = real(int32((h >> uint32(12)) & uint32(1023)))
    z = real(int32((h >> uint32(2)) & uint32(1023)))
    return (x - 511.5) * 0.001953125, (y - 511.5) * 0.001953125, (z - 511.5) * 0.001953125


@kernel
def moving_vector(h, t):
    """The random vector of the lattice point with hash h at time t."""
    local = t + real(int32(h >> uint32(8))) * 5.9604644775390625e-08
    whole = floor(local)
    tick = uint32(int32(whole))
    share, _ = fade(local - whole)
    x0, y0, z0 = vector(mixed(chained(h, tick)))
    x1, y1, z1 = vector(mixed(chained(h, uint32(tick + uint32(1)))))
    return x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)


@kernel
def corner_at(corner, root, i, j, k, x, y, z, fx, fy, fz, dx, dy, dz):
    """One of the eight lattice points around (x, y, z) in the cell (i, j, k).

    Returns its hash, the way from it, the factors of its weight and their derivatives; fx and dx
    are `fade(x)`, and so on.
    """
    number = uint32(corner)
    bit_x = uint32(number & uint32(1))
    bit_y = uint32((number >> uint32(1)) & uint32(1))
    bit_z = uint32((number >> uint32(2)) & uint32(1))
    h = chained(chained(chained(root, uint32(i + bit_x)), uint32(j + bit_y)), uint32(k + bit_z))
    u, v, w = real(int32(bit_x)), real(int32(bit_y)), real(int32(bit_z))
    up, vp, wp = 2.0 * u - 1.0, 2.0 * v - 1.0, 2.0 * w - 1.0
    a, b, c = 1.0 - u + up * fx, 1.0 - v + vp * fy, 1.0 - w + wp * fz
    return h, x - u, y - v, z - w, a, b, c, up * dx, vp * dy, wp * dz


@kernel
def noise(x, y, z, t, seed):
    """Gradient noise and its gradient (n, dn/dx, dn/dy, dn/dz) at one place and time.

    n is the sum of W (g . d) over the lattice points about, with g the point's random vector, d the
    way from it, and W = a b c its weight; grad n is the sum of W g + (g . d) grad W. Lengths are in
    cells, times in the unit in which the noise renews itself; `seed` is a whole number below 2^31,
    of any type.
    """
    left, low, near = floor(x), floor(y), floor(z)
    x, y, z = x - left, y - low, z - near
    fx, dx = fade(x)
    fy, dy = fade(y)
    fz, dz = fade(z)
    i, j, k = uint32(int32(left)), uint32(int32(low)), uint32(int32(near))
    root = mixed(uint32(int32(seed)))
    n, nx, ny, nz = 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x
    for corner in range(8):
        h, px, py, pz, a, b, c, da, db, dc = corner_at(
            corner, root, i, j, k, x, y, z, fx, fy, fz, dx, dy, dz
        )
        gx, gy, gz = moving_vector(h, t)
        ramp = gx * px + gy * py + gz * pz
        weight = a * b * c
        n += weight * ramp
        nx += weight * gx + ramp * da * b * c
        ny += weight * gy + ramp * a * db * c
        nz += weight * gz + ramp * a * b * dc
    return NOISE_SCALE * n, NOISE_SCALE * nx, NOISE_SCALE * ny, NOISE_SCALE * nz


@kernel
def single_curl(x, y, z, t, seed):
    """One octave of `curl`.

    The vector potential is the sum of W (w x d) / 2 over the lattice points about, each a whirl
    with vorticity w, the point's random vector. Its curl is the sum of
    (W + grad W . d / 2) w - (grad W . w / 2) d; names are as in `noise`.
    """
    left, low, near = floor(x), floor(y), floor(z)
    x, y, z = x - left, y - low, z - near
    fx, dx = fade(x)
    fy, dy = fade(y)
    fz, dz = fade(z)
    i, j, k = uint32(int32(left)), uint32(int32(low)), uint32(int32(near))
    root = mixed(uint32(int32(seed)))
    vx, vy, vz = 0.0 * x, 0.0 * x, 0.0 * x
    for corner in range(8):
        h, px, py, pz, a, b, c, da, db, dc = corner_at(
            corner, root, i, j, k, x, y, z, fx, fy, fz, dx, dy, dz
        )
        wx, wy, wz = moving_vector(h, t)
        gx, gy, gz = 0.5 * da * b * c, 0.5 * a * db * c, 0.5 * a * b * dc
        along = a * b * c + gx * px + gy * py + gz * pz
        back = gx * wx + gy * wy + gz * wz
        vx += along * wx - back * px
        vy += along * wy - back * py
        vz += along * wz - back * pz
    return CURL_SCALE * vx, CURL_SCALE * vy, CURL_SCALE * vz


@kernel
def fractal_noise(x, y, z, t, octaves, roughness, seed):
    """Sum of octaves of `noise`, each LACUNARITY times finer, and its gradient.

    Each octave has `roughness` times the amplitude of the one before; a part of an octave counts
    in part. The sum is scaled to root mean square 1.
    """
    value, gx, gy, gz = 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x
    power, amplitude, frequency, pace, shift = 0.0, 1.0, 1.0, 1.0, 0.0
    for octave in range(int32(-floor(-octaves))):
        share = amplitude * min(1.0, octaves - real(octave))
        n, p, q, r = noise(
            x * frequency + shift,
            y * frequency + shift,
            z * frequency + shift,
            t * pace,
            uint32(uint32(int32(seed)) + uint32(octave)),
        )
        value += share * n
        gx += share * frequency * p
        gy += share * frequency * q
        gz += share * frequency * r
        power += share * share
        amplitude *= roughness
        frequency *= LACUNARITY
        pace *= LACUNARITY * roughness
        shift += OCTAVE_SHIFT
    scale = 1.0 / sqrt(power)
    return scale * value, scale * gx, scale * gy, scale * gz


@kernel
def curl(x, y, z, t, octaves, roughness, seed):
    """Random velocity without divergence (vx, vy, vz), of root mean square speed 1.

    The curl of a random vector potential, by exact derivatives (Bridson, Hourihan, Nordenstam,
    Curl-noise for procedural fluid flow, SIGGRAPH 2007), summed over octaves. Each is LACUNARITY
    times finer than the one before, has `roughness` times its speed, and changes in the time that
    it takes to cross its own swirls; a part of an octave counts in part. Lengths are in cells,
    times in the unit in which the largest swirls renew themselves; `seed` is a whole number below
    2^31, of any type.
    """
    vx, vy, vz = 0.0 * x, 0.0 * x, 0.0 * x
    power, amplitude, frequency, pace, shift = 0.0, 1.0, 1.0, 1.0, 0.0
    for octave in range(int32(-floor(-octaves))):
        share = amplitude * min(1.0, octaves - real(octave))
        p, q, r = single_curl(
            x * frequency + shift,
            y * frequency + shift,
            z * frequency + shift,
            t * pace,
            uint32(uint32(int32(seed)) + uint32(octave)),
        )
        vx += share * p
        vy += share * q
        vz += share * r
        power += share * share
        amplitude *= roughness
        frequency *= LACUNARITY
        pace *= LACUNARITY * roughness
        shift += OCTAVE_SHIFT
    scale = 1.0 / sqrt(power)
    return scale * vx, scale * vy, scale * vz
