from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from labdrive.interfaces.plugin_set import PluginSet
from labdrive.model.errors import InputError
from labdrive.recipe.load import load, load_bench

ACME = "plugin acme of labdrive-acme 1.2 failed to import: ImportError: no module acme_sdk"
MOTION_FIELDS = (
    "there are direction, period_rate, periods, return_to_start, samples_per_period and "
    "settle_periods"
)


def problems(*arguments, **named):
    with pytest.raises(InputError) as refused:
        load(*arguments, **named)
    return str(refused.value).splitlines()


def test_a_good_recipe_loads(write, plugins):
    loaded = load(write(), plugins)
    recipe, bench = loaded.recipe, loaded.bench
    assert (recipe.kind, recipe.title, recipe.actuator, recipe.seed) == ("optimize", "", None, 1)
    assert recipe.motion.period_rate == 2.0
    assert (recipe.optimizer.use, recipe.optimizer.estimator) == ("fourier", "exact")
    assert (bench.actuators["x"].plugin, bench.actuators["x"].pitch) == ("stage", 5e-6)
    assert isinstance(recipe, plugins.experiments["optimize"].Settings)
    assert (loaded.recipe_path, loaded.bench_path) == (Path("recipe.yaml"), Path("bench.yaml"))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "kind: optimize",
            "kind: optimise",
            (
                "1:7: kind: no such experiment; did you mean optimize? there are optimize and "
                "survey; "
                f"{ACME} (got optimise)"
            ),
        ),
        ("kind: optimize", "kind: acme", f"1:7: kind: {ACME} (got acme)"),
        ("kind: optimize", "title: x", "1:1: kind: missing; there are optimize and survey"),
        (
            "kind: optimize",
            "kind: 3",
            f"1:7: kind: no such experiment; there are optimize and survey; {ACME} (got 3)",
        ),
        (
            "periods: 4",
            "period: 4",
            f"3:10: motion.period: no such field; did you mean periods? {MOTION_FIELDS}",
        ),
        ("periods: 4", "periods: 0", "3:19: motion.periods: must be 1 or more (got 0)"),
        ("periods: 4", "periods: 4.0", "3:19: motion.periods: must be a whole number (got 4.0)"),
        ("periods: 4", "periods: '4'", "3:19: motion.periods: must be a whole number (got '4')"),
        ("periods: 4", "periods: true", "3:19: motion.periods: must be a whole number (got true)"),
        ("periods: 4", "periods:", "3:18: motion.periods: must be a whole number (got nothing)"),
        (
            "periods: 4",
            "samples_per_period: 17",
            (
                "3:30: motion.samples_per_period: must be even, such as 18: half a cycle is whole "
                "samples (got 17)"
            ),
        ),
        (
            "2 Hz",
            "2",
            "3:35: motion.period_rate: a number needs a unit here, as in 2 Hz (got 2)",
        ),
        (
            "2 Hz",
            "2 um",
            "3:35: motion.period_rate: a unit like that of 2 Hz is due, not m (got 2 um)",
        ),
        ("2 Hz", "0 Hz", "3:35: motion.period_rate: must be above 0 Hz (got 0 Hz)"),
        (", period_rate: 2 Hz", "", "3:1: motion.period_rate: missing"),
        (
            "2 Hz",
            "2 Hz, direction: foward",
            (
                "3:52: motion.direction: must be forward or backward; did you mean forward? "
                "(got foward)"
            ),
        ),
        (
            "2 Hz",
            "2 Hz, return_to_start: yes",
            "3:58: motion.return_to_start: must be true or false (got yes)",
        ),
        (
            "{periods: 4, period_rate: 2 Hz}",
            "fast",
            "3:9: motion: must be a mapping of fields (got fast)",
        ),
        ("sensor: ruler", "sensor: 12", "4:9: sensor: must be text; quotes make it so (got 12)"),
        ("sensor: ruler", "seed: -1", "4:7: seed: must be 0 or more (got -1)"),
        (
            "use: fourier",
            "use: furier",
            (
                "5:18: optimizer.use: no such optimizer; did you mean fourier? there are bisect "
                "and "
                f"fourier; {ACME} (got furier)"
            ),
        ),
        ("use: fourier", "gain: 1", "5:1: optimizer.use: missing; there are bisect and fourier"),
        (
            "{use: fourier}",
            "fourier",
            (
                "5:12: optimizer: must be a mapping with use: NAME; there are bisect and fourier "
                "(got fourier)"
            ),
        ),
        (
            "use: fourier",
            "use: fourier, steps: 2",
            "5:27: optimizer.steps: no such field; there are estimator, gain and use",
        ),
        (
            "use: fourier",
            "use: fourier, gain: 1.5",
            "5:33: optimizer.gain: must be 1 or less (got 1.5)",
        ),
        (
            "use: fourier}",
            "use: fourier}\nwaveform: {trajectory: box, amplitude: 20}",
            (
                "6:40: waveform.amplitude: a number needs a unit here, as in 48 V; or it must be "
                "max "
                "(got 20)"
            ),
        ),
        ("use: fourier}", "use: fourier}\nloads: 5 N", "6:8: loads: must be a list (got 5 N)"),
        (
            "use: fourier}",
            "use: fourier}\nloads: [1 N, 3 V]",
            "6:14: loads.1: a unit like that of 10 N is due, not V (got 3 V)",
        ),
        (
            "use: fourier}",
            "use: fourier}\nstages:\n- {max_iterations: 2}\n- {max_iter: 2}",
            (
                "8:4: stages.1.max_iter: no such field; did you mean max_iterations? there is "
                "max_iterations"
            ),
        ),
        (
            "use: fourier}",
            "use: fourier}\nfallback: {use: bisect, steps: x}",
            "6:32: fallback.steps: must be a whole number (got x)",
        ),
        ("bench: bench.yaml", "bench: b.yaml", "2:8: bench: there is no file b.yaml (got b.yaml)"),
        ("bench: bench.yaml\n", "", "1:1: bench: missing; name a bench file here, or with --bench"),
        ("bench: bench.yaml", "bench: 5", "2:8: bench: must be text; quotes make it so (got 5)"),
        (
            "periods: 4",
            "periods: 4, periods: 5",
            "3:22: motion.periods: given twice, first on line 3",
        ),
        ("periods: 4", "periods: .inf", "3:19: motion.periods: a number must be finite (got .inf)"),
    ],
)
def test_each_problem_of_a_recipe_has_its_line(write, plugins, good_recipe, old, new, expected):
    assert old in good_recipe
    found = problems(write(good_recipe.replace(old, new)), plugins)
    assert f"recipe.yaml:{expected}" in found
    assert len(found) <= 2


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "plugin: stage",
            "plugin: stag",
            (
                "2:15: actuators.x.plugin: no such actuator; did you mean stage? there are slide "
                "and "
                f"stage; {ACME} (got stag)"
            ),
        ),
        ("plugin: stage", "plugin: acme", f"2:15: actuators.x.plugin: {ACME} (got acme)"),
        (
            "plugin: stage, ",
            "",
            "2:3: actuators.x.plugin: missing; there are slide and stage",
        ),
        ("5 um", "-5 um", "2:29: actuators.x.pitch: must be above 0 m (got -5 um)"),
        (
            "pitch",
            "pich",
            (
                "2:22: actuators.x.pich: no such field; did you mean pitch? there are delay, "
                "pitch and "
                "plugin"
            ),
        ),
        (
            "  x:",
            "  1x:",
            (
                "2:3: actuators.1x: a name begins with a letter and goes on with letters, "
                "digits, _ "
                "or -"
            ),
        ),
        ("  ruler:", "  time:", "4:3: sensors.time: no sensor can be called phase, time or sample"),
        (
            "  ruler: {plugin: ruler}\n",
            "  ruler: {plugin: ruler}\nactuator: {}\n",
            (
                "5:1: actuator: no such field; did you mean actuators? there are actuators, "
                "interlocks, limits, "
                "links, load and sensors"
            ),
        ),
        ("  ruler: {plugin: ruler}\n", "  {}\n", "4:3: sensors: must not be empty"),
        (
            "plugin: ruler}",
            "plugin: ruler, scale: 3}",
            (
                "4:33: sensors.ruler.scale: a number needs a unit here, as in 0.044 deg, or 3 1 "
                "for a "
                "pure number (got 3)"
            ),
        ),
        (
            "plugin: ruler}",
            "plugin: ruler, lens: 3}",
            "4:26: sensors.ruler.lens: no such field; there are file, plugin and scale",
        ),
        (
            "plugin: ruler}",
            "plugin: ruler, file: no.csv}",
            "4:32: sensors.ruler.file: there is no file no.csv (got no.csv)",
        ),
        (
            "sensors:",
            "limits: {travel: {min: 5 mm, max: 1 mm}}\nsensors:",
            "3:18: limits.travel: min must be below max",
        ),
    ],
)
def test_each_problem_of_a_bench_has_its_line(write, plugins, good_bench, old, new, expected):
    assert old in good_bench
    found = problems(write(bench=good_bench.replace(old, new)), plugins)
    assert found == [f"bench.yaml:{expected}"]


def test_all_problems_at_once_in_the_order_of_the_files(write, plugins):
    recipe = (
        "kind: optimize\nbench: bench.yaml\nmotion: {periods: 0, period_rate: 2}\nloads: [1]\n"
        "a: .nan\na: 1\n"
    )
    bench = "actuators: {x: {plugin: stage, pitch: 5}}\nsensors: {r: {plugin: rule}}\n"
    places = [line.split(": ")[:2] for line in problems(write(recipe, bench), plugins)]
    assert places == [
        ["recipe.yaml:1:1", "sensor"],
        ["recipe.yaml:1:1", "optimizer"],
        ["recipe.yaml:3:19", "motion.periods"],
        ["recipe.yaml:3:35", "motion.period_rate"],
        ["recipe.yaml:4:9", "loads.0"],
        ["recipe.yaml:5:4", "a"],
        ["recipe.yaml:6:1", "a"],
        ["bench.yaml:1:39", "actuators.x.pitch"],
        ["bench.yaml:2:23", "sensors.r.plugin"],
    ]


def test_the_file_is_named_as_it_was_typed(tmp_path, plugins, write):
    write("kind: optimize\nbench: sub/../no.yaml\n")
    absolute = problems(tmp_path / "recipe.yaml", plugins)
    assert f"{tmp_path}/recipe.yaml:2:8: bench: there is no file {tmp_path}/no.yaml" in absolute[-1]
    assert problems("recipe.yaml", plugins)[-1].startswith(
        "recipe.yaml:2:8: bench: there is no file no"
    )


def test_files_that_are_not_there(write, plugins):
    assert problems("no.yaml", plugins) == ["no.yaml: there is no such file"]
    assert problems(write(), plugins, "no.yaml") == ["no.yaml: there is no such file"]


def test_a_recipe_that_is_no_mapping(write, plugins):
    assert problems(write("- kind"), plugins) == ["recipe.yaml:1:1: must be a mapping of fields"]
    assert problems(write("a: 'x"), plugins) == ["recipe.yaml:1:6: a quote is not closed"]


def test_another_bench_takes_the_place_of_the_recipes(write, plugins, tmp_path, good_bench):
    (tmp_path / "other.yaml").write_text(good_bench.replace("stage", "slide"))
    loaded = load(write(), plugins, bench="other.yaml")
    assert loaded.bench.actuators["x"].plugin == "slide"
    assert loaded.recipe.bench == str(tmp_path / "other.yaml")


def test_a_bench_alone(write, plugins, good_bench):
    write(bench=good_bench + "links: {can: {plugin: bus}}\n")
    assert load_bench("bench.yaml", plugins).links["can"].port == "can0"
    write(bench="actuators: {}\n")
    with pytest.raises(InputError, match=r"bench\.yaml:1:1: sensors: missing"):
        load_bench("bench.yaml", plugins)


def test_no_plugins_at_all(write):
    assert problems(write(), PluginSet())[0] == (
        "recipe.yaml:1:7: kind: no such experiment; there is none (got optimize)"
    )


def test_later_checks_can_point_at_a_field(write, plugins, good_recipe):
    loaded = load(write(good_recipe + "loads: [1 N, 2 N]\n"), plugins)
    told = [
        loaded.problem("recipe", "sensor", "the bench has no such sensor", "ruler"),
        loaded.problem("recipe", "motion.settle_periods", "too few"),
        loaded.problem("recipe", "loads.1", "too much"),
        loaded.problem("recipe", "", "does not fit the bench"),
        loaded.problem("bench", "limits.travel", "missing"),
        loaded.problem("bench", "actuators.x.pitch", "too fine", 5e-06),
    ]
    assert [str(problem) for problem in told] == [
        "recipe.yaml:4:9: sensor: the bench has no such sensor (got ruler)",
        "recipe.yaml:3:1: motion.settle_periods: too few",
        "recipe.yaml:6:14: loads.1: too much",
        "recipe.yaml:1:1: does not fit the bench",
        "bench.yaml:1:1: limits.travel: missing",
        "bench.yaml:2:29: actuators.x.pitch: too fine (got 5e-06)",
    ]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    recipe=st.text(alphabet=" \n-:?[]{},&*!|>'\"%@#.~013abekimnoptuz_", max_size=80),
    values=st.lists(st.text(max_size=12), max_size=3),
)
def test_no_recipe_makes_a_traceback(write, plugins, recipe, values):
    lines = [
        f"{name}: {value}" for name, value in zip(("motion", "loads", "a"), values, strict=False)
    ]
    for text in (recipe, "\n".join(["kind: optimize", *lines])):
        with pytest.raises(InputError):
            load(write(text.encode("utf-8", "replace").decode()), plugins)


junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["use", "plugin", "x", "gain", "steps"]), inner)
    ),
    max_leaves=6,
)
fields = [
    "motion",
    "sensor",
    "optimizer",
    "fallback",
    "stop",
    "loads",
    "stages",
    "waveform",
    "seed",
]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(name=st.sampled_from(fields), value=junk)
def test_no_value_anywhere_makes_a_traceback(write, plugins, name, value):
    with suppress(InputError):
        load(write(), plugins, overrides=[f"{name}={value!r}"])
