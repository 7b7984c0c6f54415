import pytest

from labdrive.model.errors import InputError
from labdrive.recipe.load import load


def problems(recipe, plugins, *overrides):
    with pytest.raises(InputError) as refused:
        load(recipe, plugins, overrides=overrides)
    return str(refused.value).splitlines()


def test_values_are_yaml_and_come_before_validation(write, plugins, good_recipe):
    overrides = (
        "motion.periods=64",
        "motion.period_rate=500 mHz",
        "optimizer={use: bisect, steps: 7}",
        "loads.1=3 N",
        "stop.max_iterations=2",
        "title=",
        "title=a = b",
    )
    recipe = load(write(good_recipe + "loads: [1 N, 2 N]\n"), plugins, overrides=overrides).recipe
    assert (recipe.motion.periods, recipe.motion.period_rate) == (64, 0.5)
    assert (recipe.optimizer.use, recipe.optimizer.steps) == ("bisect", 7)
    assert recipe.loads == [1.0, 3.0]
    assert recipe.stop.max_iterations == 2
    assert recipe.title == "a = b"


def test_an_override_can_mend_a_recipe(write, plugins, good_recipe):
    write(good_recipe.replace("periods: 4", "periods: 0"))
    assert load("recipe.yaml", plugins, overrides=["motion.periods=1"]).recipe.motion.periods == 1


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("motion.periods=0", "motion.periods: must be 1 or more (got 0)"),
        (
            "motion={periods: 0, period_rate: 1 Hz}",
            "motion.periods: must be 1 or more (got 0)",
        ),
        (
            "stop.max_iter=3",
            "stop.max_iter: no such field; did you mean max_iterations? there is max_iterations",
        ),
        ("sensor.name=3", "sensor has no name that can be set"),
        ("loads.2=3 N", "loads has no 2 that can be set"),
        ("loads.x=3 N", "loads has no x that can be set"),
        ("sensor", "write it as FIELD=VALUE, as in motion.periods=64"),
        ("=3", "write it as FIELD=VALUE, as in motion.periods=64"),
        ("motion..periods=3", "write it as FIELD=VALUE, as in motion.periods=64"),
        ("seed=[1", "seed: a ',' or ']' is missing"),
        ("seed=.nan", "seed: a number must be finite (got .nan)"),
        ("motion.periods=!!int 3", None),
    ],
)
def test_its_problems_carry_its_own_words(write, plugins, good_recipe, override, expected):
    found = problems(write(good_recipe + "loads: [1 N, 2 N]\n"), plugins, override)
    expected = expected or (
        "motion.periods: tags are not taken: recipes and benches hold plain data "
        "(got tag:yaml.org,2002:int)"
    )
    assert found == [f"--set {override}: {expected}"]


def test_a_recipe_that_cannot_be_read_is_told_first(write, plugins):
    assert problems(write("a: 'x"), plugins, "seed=3") == ["recipe.yaml:1:6: a quote is not closed"]
