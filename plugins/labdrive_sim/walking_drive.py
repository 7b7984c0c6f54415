"""A walking piezo drive: two groups of two bimorph legs that carry a rod in turn.

Elements with hysteresis move the tips; tips press on the rod, stick and slip; a leaf spring holds
the legs and a guide the rod. The defaults are those of a drive like the paper's.
"""

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.quantities import (
    Force,
    Length,
    LengthPerVoltage,
    Stiffness,
    Time,
    Viscosity,
    Voltage,
)
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Motion
from labdrive.model.waveform import WaveformTable
from labdrive_sim.plant import Stretch
from labdrive_sim.table_player import walked
from labdrive_sim.walking_model import CHANNELS, Parameters, Walk, at_rest

UM = 1e-6
SURFACE_NODES = 8192
CREEP_S = (0.1, 1.0, 10.0)


class WalkingDrive:
    """The plant. Its parameters are nobody's business but its own: optimizers must not read them.

    Element h = U + sum of w s_j play_r_j(U), scaled to unit gain over the full voltage; tip
    x = a (h0 - h1), y = b (h0 + h1); normal forces sum k_n (y - z)+ = preload + spring z;
    tangential forces sum clip(k_t (x - X - slip), +- mu N) = load + guide friction + viscosity.
    """

    class Settings(SettingsBase):
        """Physical parameters."""

        seed: int = Field(default=1, ge=0, description="Draws the mismatch of the legs.")
        full_voltage: Voltage = Field(default=48.0, gt=0)
        x_per_volt: LengthPerVoltage = Field(default=0.036e-6, gt=0)
        y_per_volt: LengthPerVoltage = Field(default=0.025e-6, gt=0)
        loop_width: float = Field(
            default=0.12,
            ge=0,
            lt=0.3,
            description="Hysteresis of an element over its full voltage, as a share of the stroke; "
            "that of a leg led along the ellipse comes out 0.7 times as wide.",
        )
        play_min: Voltage = Field(default=2.0, gt=0, description="Radius of the first play.")
        play_max: Voltage = Field(default=18.0, gt=0, description="Radius of the last play.")
        plays: int = Field(default=8, ge=2, le=64)
        play_spread: float = Field(default=0.1, ge=0, description="Spread of the plays' weights.")
        creep: float = Field(default=0.0, ge=0, description="Share added at 0.1, 1 and 10 s each.")
        amplifier_time: Time = Field(default=1.5e-4, ge=0, description="Pole of the amplifiers.")
        group_mismatch: float = Field(default=0.025, ge=0)
        leg_mismatch: float = Field(default=0.01, ge=0)
        element_mismatch: float = Field(default=0.01, ge=0)
        height_mismatch: Length = Field(default=20e-9, ge=0)
        preload: Force = Field(default=180.0, gt=0)
        spring: Stiffness = Field(default=6e6, ge=0)
        normal_stiffness: Stiffness = Field(default=75e6, gt=0)
        tangential_stiffness: Stiffness = Field(default=100e6, gt=0)
        friction: float = Field(default=0.3, gt=0)
        friction_spread: float = Field(default=0.002, ge=0, description="Along the rod.")
        roughness: Length = Field(default=2e-9, ge=0, description="Height of the rod, rms.")
        surface_pitch: Length = Field(default=1e-6, gt=0, description="Grain of the rod's surface.")
        guide_friction: Force = Field(default=0.5, ge=0)
        guide_stiffness: Stiffness = Field(default=10e6, gt=0)
        viscosity: Viscosity = Field(default=10.0, gt=0)
        load: Force = Field(default=0.0, description="External, against forward travel.")

        @model_validator(mode="after")
        def _loop_can_be_so_wide(self) -> Self:
            """Refuse plays that no weight makes such a loop of."""
            if not self.play_min < self.play_max < self.full_voltage / 2:
                raise ValueError("play_min must be below play_max, that below half of full_voltage")
            height, width = loop_of_plays(self)
            widest = width / height
            if self.loop_width >= widest:
                raise ValueError(
                    f"plays up to {self.play_max:g} V can only make loops narrower than "
                    f"{widest:.2g}, not {self.loop_width:g}; raise play_max"
                )
            return self

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._context = context
        self._parameters = parameters(settings)
        self._state = at_rest(settings.plays, len(self._parameters.creep_s))
        self._stretch = Stretch.at_rest()
        self._outputs = np.zeros(CHANNELS)

    def connect(self) -> None:
        """Compile the model, or load what was compiled before, so that no motion has to wait."""
        walk = compiled_walk()
        walk(self._parameters, self._state, np.zeros((0, CHANNELS)), 1.0)

    def close(self) -> None:
        """Nothing to release."""

    @property
    def outputs(self) -> FloatArray:
        """The voltages applied last [V], shape (4,)."""
        return self._outputs

    @property
    def stretch(self) -> Stretch:
        """The steps made by the last call of `follow`."""
        return self._stretch

    def follow(self, outputs: FloatArray, time: FloatArray, step_s: float) -> None:
        """Apply voltages [V], shape (steps, 4), each for `step_s`; `time` [s] names them."""
        position, force, height = compiled_walk()(self._parameters, self._state, outputs, step_s)
        self._stretch = Stretch(time, UM * position, force, UM * height)
        self._outputs = outputs[-1].copy()

    def bear(self, *, weight: float = 0.0, friction: float = 0.0) -> None:
        """Bear a load besides that of the settings.

        `weight` [N] pulls against forward travel, `friction` [N] against any travel.
        """
        self._parameters = self._parameters._replace(
            load=self._settings.load + weight,
            guide_friction=self._settings.guide_friction + friction,
        )

    def truth(self, table: WaveformTable, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return phase [rad] and position [m] at every entry of the table, without any noise.

        A twin of the drive walks, from rest and on a perfect rod. For tests only: it is what no
        bench can know, and neither may an optimizer.
        """
        perfect = self._settings.model_copy(update={"roughness": 0.0, "friction_spread": 0.0})
        return walked(WalkingDrive(perfect, self._context), table, motion)


def compiled_walk() -> Walk:
    """Return the compiled loop: numba is imported here, where something is about to move."""
    from labdrive_sim.walking_kernel import walk

    return walk


def parameters(settings: WalkingDrive.Settings) -> Parameters:
    """Return the constants of the kernel; everything random comes from the plant's seed."""
    random = np.random.default_rng(settings.seed)
    groups = np.repeat(random.normal(0, settings.group_mismatch, (2, 2)), 2, axis=1)
    legs = random.normal(0, settings.leg_mismatch, (2, 4))
    stroke = 1 + groups + legs
    elements = 1 + random.normal(0, settings.element_mismatch, 8)
    heights = random.normal(0, settings.height_mismatch, 4)
    shapes = 1 + random.normal(0, settings.play_spread, (8, settings.plays))
    radii = play_radii(settings)
    weights = shapes * play_weight(settings)
    swing = settings.full_voltage - 2 * radii
    return Parameters(
        radii=radii,
        weights=weights,
        gains=elements / (1 + weights @ swing / settings.full_voltage),
        creep_s=np.array(CREEP_S if settings.creep else ()),
        creep_share=settings.creep,
        amplifier_s=settings.amplifier_time,
        x_per_volt=stroke[0] * settings.x_per_volt / UM,
        y_per_volt=stroke[1] * settings.y_per_volt / UM,
        heights=heights / UM,
        preload=settings.preload,
        spring=settings.spring * UM,
        normal_stiffness=settings.normal_stiffness * UM,
        tangential_stiffness=settings.tangential_stiffness * UM,
        friction=settings.friction,
        guide_friction=settings.guide_friction,
        guide_stiffness=settings.guide_stiffness * UM,
        viscosity=settings.viscosity * UM,
        load=settings.load,
        surface_pitch=settings.surface_pitch / UM,
        roughness=random.normal(0, settings.roughness / UM, (4, SURFACE_NODES)),
        friction_spread=random.normal(0, settings.friction_spread, (4, SURFACE_NODES)),
    )


def play_weight(settings: WalkingDrive.Settings) -> float:
    """Return the weight of each play that gives the loop width asked for.

    Over the full voltage U, a play of radius r makes a loop U - 2 r high and, half-way up,
    min(2 r, U - 2 r) wide; the voltage itself is U high.
    """
    height, width = loop_of_plays(settings)
    return settings.loop_width * settings.full_voltage / (width - settings.loop_width * height)


def loop_of_plays(settings: WalkingDrive.Settings) -> tuple[float, float]:
    """Return height and width of all plays' loops together [V]."""
    radii = play_radii(settings)
    heights = settings.full_voltage - 2 * radii
    return float(np.sum(heights)), float(np.sum(np.minimum(2 * radii, heights)))


def play_radii(settings: WalkingDrive.Settings) -> FloatArray:
    """Return the radius of each play [V]."""
    return np.linspace(settings.play_min, settings.play_max, settings.plays)
