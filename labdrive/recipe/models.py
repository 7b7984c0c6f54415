"""The models of recipes and benches, put together from the settings of the installed plugins."""

from collections.abc import Callable, Mapping
from functools import reduce
from operator import or_
from types import GenericAlias
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    create_model,
)
from pydantic_core import PydanticCustomError

from labdrive.interfaces.interlocks import Interlock
from labdrive.interfaces.limits import Limits
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.interfaces.settings import BenchName, PluginSlot, Settings
from labdrive.model.wording import listed, no_such, offer

TAG = "plugin:"
"""Begins the parts of an error's location that name a choice and not a field."""

RESERVED_SENSOR_NAMES = ("phase", "time", "sample")
"""Recordings have variables and a dimension of these names."""

AnyType: TypeAlias = Any  # a type made at run time, which no annotation can name

_COMMON: Mapping[str, AnyType] = {
    "title": (str, Field(default="", description="What the run is for, in a line.")),
    "bench": (str | None, Field(default=None, description="Bench file, relative to the recipe.")),
    "actuator": (
        Annotated[str | None, BenchName("actuators")],
        Field(default=None, description="The bench's actuator to drive, if it has several."),
    ),
    "seed": (int, Field(default=1, ge=0, description="Seeds all that is simulated.")),
}


class _Strict(Settings):
    """Last among the bases of a model made here, so that every plugin's settings are strict.

    A model made at run time has no source in which to look for the docstrings of its fields.
    """

    model_config = ConfigDict(use_attribute_docstrings=False)


def recipe_model(plugins: PluginSet) -> AnyType:
    """Return the type of recipes of every installed kind, their plugins' settings included."""
    return _choice("experiments", "kind", plugins, _COMMON)


def bench_model(plugins: PluginSet) -> type[Settings]:
    """Return the model of benches: links, actuators, sensors, a load and limits."""
    name: AnyType = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
    sensor: AnyType = Annotated[name, AfterValidator(_not_reserved)]
    roles = (("links", name), ("actuators", name), ("sensors", sensor))
    fields: dict[str, AnyType] = {
        role: (GenericAlias(dict, (names, _choice(role, "plugin", plugins))), _DEVICES[role])
        for role, names in roles
    }
    fields["load"] = (
        _choice("loads", "plugin", plugins) | None,
        Field(default=None, description="What puts an external force on the actuator."),
    )
    fields["limits"] = (
        Limits,
        Field(default_factory=Limits, description="What no recipe can exceed."),
    )
    fields["interlocks"] = (
        GenericAlias(tuple, (Interlock, Ellipsis)),
        Field(default=(), description="Conditions under which a run may start and go on."),
    )
    doc = "A bench: its devices by name, and limits that no recipe can exceed."
    return create_model("bench", __base__=_Strict, __doc__=doc, **fields)


_DEVICES: Mapping[str, AnyType] = {
    "links": Field(default_factory=dict, description="Connections that several devices share."),
    "actuators": Field(min_length=1, description="What moves, commanded by a phase."),
    "sensors": Field(min_length=1, description="What is read."),
}


def _not_reserved(name: str) -> str:
    if name in RESERVED_SENSOR_NAMES:
        raise ValueError(f"no sensor can be called {listed(RESERVED_SENSOR_NAMES)}")
    return name


def _choice(
    role: str, key: str, plugins: PluginSet, common: Mapping[str, AnyType] | None = None
) -> AnyType:
    """Return the union of one role's settings, told apart by the plugin's name under `key`."""
    refusal = _refusal(role, key, plugins)
    members = [
        Annotated[_settings(role, key, name, plugins, common or {}), Tag(TAG + name)]
        for name in plugins.role(role)
    ]
    if not members:
        return Annotated[Settings, BeforeValidator(refusal)]
    return Annotated[
        reduce(or_, members), Discriminator(_tag_reader(key)), BeforeValidator(refusal)
    ]


def _tag_reader(key: str) -> Callable[[Any], str]:
    def tag(given: AnyType) -> str:
        name = given.get(key) if isinstance(given, dict) else getattr(given, key, None)
        return f"{TAG}{name}"

    return tag


def _settings(
    role: str, key: str, name: str, plugins: PluginSet, common: Mapping[str, AnyType]
) -> type[BaseModel]:
    """Return a plugin's settings with its name under `key`, its own slots filled."""
    own = plugins.role(role)[name].Settings
    chosen: AnyType = (Literal[name], Field(description=own.__doc__))
    fields = {key: chosen, **common, **_filled_slots(own, plugins)}
    return create_model(f"{role}_{name}", __base__=(own, _Strict), __doc__=own.__doc__, **fields)


def _filled_slots(own: type[BaseModel], plugins: PluginSet) -> dict[str, AnyType]:
    """Return the fields that other plugins fill, each as the union of what can fill it."""
    fields: dict[str, AnyType] = {}
    for name, info in own.model_fields.items():
        for slot in (mark for mark in info.metadata if isinstance(mark, PluginSlot)):
            filled = _choice(slot.role, slot.key, plugins)
            optional = filled | None if info.default is None else filled
            fields[name] = (optional, Field(default=info.default, description=info.description))
    return fields


def _refusal(role: str, key: str, plugins: PluginSet) -> Callable[[Any], Any]:
    """Return a validator that says, in words, what is wrong with the name under `key`."""
    known = plugins.role(role)

    def check(given: AnyType) -> AnyType:
        if not isinstance(given, dict):
            text = f"must be a mapping with {key}: NAME; {offer(known)}"
            raise PydanticCustomError("not_a_mapping", "{message}", {"message": text})
        if key not in given:
            raise _error("choice_missing", f"missing; {offer(known)}", key)
        if not isinstance(given[key], str) or given[key] not in known:
            raise _error("choice_unknown", unknown_plugin(given[key], role, plugins), key)
        return given

    return check


def unknown_plugin(name: AnyType, role: str, plugins: PluginSet) -> str:
    """Return what is to be said of a name that no plugin of the role has."""
    for broken in plugins.broken:
        if broken.name == name:
            return f"plugin {name} of {broken.distribution} failed to import: {broken.error}"
    text = no_such(role.removesuffix("s"), str(name), plugins.role(role))
    for broken in plugins.broken:
        text += f"; plugin {broken.name} of {broken.distribution} failed to import: {broken.error}"
    return text


def _error(kind: str, message: str, key: str) -> PydanticCustomError:
    return PydanticCustomError(kind, "{message}", {"message": message, "key": key})
