"""Compares what points see of directions with rays along them, one by one."""

import numpy as np
import pytest

from bvh_search import Tracer, Tree, sky

RANDOM = np.random.default_rng(70)
TRIANGLES = RANDOM.uniform(0, 10, (200, 1, 3)) + RANDOM.uniform(-1, 1, (200, 3, 3))
CORNERS = TRIANGLES.reshape(-1, 3)
# In general places and on corners, and more than one part of a query.
POINTS = np.concatenate([RANDOM.uniform(-1, 11, (900, 3)), CORNERS[:100]])
DIRECTIONS = np.concatenate([RANDOM.normal(size=(66, 3)), [[0, 0, 1], [1, 0, 0]], CORNERS[:2] - CORNERS[5]])
NORMALS = RANDOM.normal(size=POINTS.shape)
NORMALS[7] = 0
TRACERS = {
    np.float32: Tracer(Tree.from_triangles(TRIANGLES, work=1000)),
    np.float64: Tracer(Tree.from_triangles(TRIANGLES + 1e6, work=1000, precision="double")),
}
BOTH = pytest.mark.parametrize("real", TRACERS)


def given(real):
    """The tracer, and points, directions and normals as they count there."""
    offset = 1e6 if real == np.float64 else 0
    return TRACERS[real], (POINTS + offset).astype(real), DIRECTIONS.astype(real), NORMALS.astype(real)


def free_rays(tracer, points, directions, **limits):
    origins = np.repeat(points, len(directions), axis=0)
    return ~tracer.any(origins, np.tile(directions, (len(points), 1)), **limits).reshape(len(points), -1)


@BOTH
@pytest.mark.parametrize("limits", [{}, {"t_min": 0.1}, {"t_max": 0.7}, {"t_min": 1 / 3, "t_max": 3}, {"t_min": 2, "t_max": 1}])
def test_a_direction_is_free_where_a_ray_along_it_hits_nothing(real, limits):
    tracer, points, directions, normals = given(real)
    expected = free_rays(tracer, points, directions, **limits)
    free = tracer.visible(points, directions, **limits)
    assert (free.dtype, free.shape) == (np.bool_, (1000, 70))
    np.testing.assert_array_equal(free, expected)
    assert 1000 < free.sum() < 69_000 or limits.get("t_min") == 2 and free.all()
    above = np.float64(normals) @ np.float64(directions).T > 0
    np.testing.assert_array_equal(tracer.visible(points, directions, normals=normals, **limits), expected & above)


@BOTH
def test_weights_are_summed_over_free_directions(real):
    tracer, points, directions, normals = given(real)
    weights = RANDOM.normal(size=(70, 3))
    free = tracer.visible(points, directions)
    above = tracer.visible(points, directions, normals=normals)
    lengths = np.linalg.norm(np.float64(normals), axis=1)
    lengths[7] = 1
    d = np.float64(directions)
    cosines = (np.float64(normals) / lengths[:, None]) @ (d / np.linalg.norm(d, axis=1, keepdims=True)).T
    close = {"rtol": 1e-12, "atol": 1e-12}
    for options, counts in [
        ({}, free),
        ({"normals": normals}, above),
        ({"normals": normals, "cosine": True}, above * cosines),
    ]:
        sums = tracer.visible(points, directions, weights, **options)
        assert (sums.dtype, sums.shape) == (np.float64, (1000, 3))
        np.testing.assert_allclose(sums, counts @ weights, **close)
        one = tracer.visible(points, directions, weights[:, 1], **options)
        assert one.shape == (1000,)
        np.testing.assert_array_equal(one, sums[:, 1])


@BOTH
def test_arrays_are_read_as_those_of_rays(real):
    tracer, points, directions, _ = given(real)
    doubles = points + 1e-9, directions + 1e-9
    limits = {"t_min": 0.1, "t_max": 0.7}
    expected = free_rays(tracer, *doubles, **limits)
    mirrored = [np.asfortranarray(array)[::-1] for array in doubles]
    np.testing.assert_array_equal(tracer.visible(*mirrored, **limits)[::-1, ::-1], expected)
    # In f64, components below 2^-150 count as 0.
    tiny = np.where(np.arange(3) == 2, directions[:67], 1e-60)
    np.testing.assert_array_equal(tracer.visible(points, tiny), tracer.visible(points, tiny * [0, 0, 1]))


@BOTH
def test_there_may_be_no_points_directions_or_triangles(real):
    tracer, points, directions, _ = given(real)
    none = np.zeros((0, 3))
    assert tracer.visible(none, directions).shape == (0, 70)
    assert tracer.visible(points, none).shape == (1000, 0)
    assert tracer.visible(none, none, np.zeros((0, 2))).shape == (0, 2)
    np.testing.assert_array_equal(tracer.visible(points, none, np.zeros((0, 2))), np.zeros((1000, 2)))
    precision = "double" if real == np.float64 else "single"
    empty = Tracer(Tree.from_triangles(np.zeros((0, 3, 3)), work=1, precision=precision))
    assert empty.visible(points, directions).all()


UP = [[0, 0, 1]]
NAN = [[0, 0, 0], [0, np.nan, 0]]


@BOTH
@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (([[0, 0]], UP), {}, r"^points has shape \(1, 2\); accepted: \(m, 3\)$"),
        (([0, 0, 0], UP), {}, r"^points has shape \(3,\); accepted: \(m, 3\)$"),
        ((NAN, UP), {}, r"^points has \[0.0, NaN, 0.0\] in row 1; accepted: (finite|0 or)"),
        ((UP, [0, 0, 1]), {}, r"^directions has shape \(3,\); accepted: \(m, 3\)$"),
        ((UP, NAN), {}, r"^directions has \[0.0, 0.0, 0.0\] in row 0; accepted: (finite|0 or)"),
        ((UP, [["a"] * 3]), {}, "^directions has dtype <U1; accepted: real numbers"),
        ((UP, UP), {"normals": UP * 2}, r"^normals has shape \(2, 3\); accepted: \(1, 3\), as points$"),
        ((UP * 2, UP), {"normals": NAN}, r"^normals has \[0.0, NaN, 0.0\] in row 1; accepted: (finite|0 or)"),
        ((UP, UP, [1, 2]), {}, r"^weights has shape \(2,\); accepted: \(1,\) or \(1, k\), as directions$"),
        ((UP, UP, [[]]), {}, r"^weights has shape \(1, 0\); accepted: \(1,\) or \(1, k\), as directions$"),
        ((UP, UP, 1), {}, r"^weights has shape \(\); accepted: \(1,\) or \(1, k\), as directions$"),
        ((UP, UP, [np.inf]), {}, "^weight 0 is inf; accepted: finite"),
        ((UP, UP), {"normals": UP, "cosine": True}, "^cosine is True; accepted: with weights and normals$"),
        ((UP, UP, [1]), {"cosine": True}, "^cosine is True; accepted: with weights and normals$"),
        ((UP, UP), {"t_min": [0, 0]}, r"^t_min has shape \(2,\); accepted: a number$"),
        ((UP, UP), {"t_min": -1}, "^the range -1..=inf must not be NaN and must start at 0 or later"),
        ((UP, UP), {"t_max": np.nan}, "^the range 0..=NaN must not be NaN"),
    ],
)
def test_errors_name_the_argument(real, arguments, options, message):
    with pytest.raises(ValueError, match=message):
        TRACERS[real].visible(*arguments, **options)


@pytest.mark.parametrize(("arguments", "count"), [({}, 145), ({"patches": 577}, 577), ({"uniform": 1000}, 1000)])
def test_a_built_in_sky_is_a_hemisphere_that_a_free_surface_sees_whole(arguments, count):
    directions, weights = sky(**arguments)
    assert (directions.shape, weights.shape) == ((count, 3), (count,))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    assert (directions[:, 2] > 0).all()
    assert weights.sum() == pytest.approx(2)
    # Above all triangles; and below a roof nothing.
    roof = Tracer(Tree.from_triangles([[[-99, -99, 0], [99, -99, 0], [0, 99, 0]]], work=1))
    seen = roof.visible([[0, 0, 1], [0, 0, -1e-3]], directions, weights, normals=UP * 2, cosine=True)
    assert seen == pytest.approx([1, 0], abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"patches": 146}, r"^patches is 146; accepted: 145, 577, 1297 and so on, 144 k\^2 \+ 1$"),
        ({"patches": 1}, "^patches is 1; accepted: 145"),
        ({"patches": -1}, "^patches is -1; accepted: 1 to 16777216$"),
        ({"uniform": 0}, "^uniform is 0; accepted: 1 to 16777216$"),
        ({"patches": 145, "uniform": 9}, "^patches and uniform; accepted: one of them$"),
    ],
)
def test_errors_of_skies_name_the_argument(arguments, message):
    with pytest.raises(ValueError, match=message):
        sky(**arguments)
