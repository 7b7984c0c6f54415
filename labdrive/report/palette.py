"""The colours of a report, for a light page and for a dark one."""

import re

# Channels are those of Okabe and Ito, iterations those of viridis: told apart by those who see
# few colours too. Figures are drawn in the light ones, which must therefore all differ.
PALETTE = {
    "ink": ("#1b2227", "#e4e9ec"),
    "soft": ("#5b6771", "#9dabb5"),
    "line": ("#d8dde1", "#39444c"),
    "grid": ("#e7eaed", "#2c353c"),
    "paper": ("#fefefe", "#1b2227"),
    "back": ("#f3f5f6", "#12171a"),
    "accent": ("#c4500c", "#f59a5b"),
    "after": ("#0b62a5", "#6db8ee"),
    "before": ("#7c8893", "#92a0ab"),
    "noise": ("#d5e0e9", "#2b3e4e"),
    "channel-0": ("#0072b2", "#5cb3ea"),
    "channel-1": ("#d55e00", "#f08a3c"),
    "channel-2": ("#009e73", "#35c79b"),
    "channel-3": ("#cc79a7", "#e29cc3"),
    "channel-4": ("#e69f00", "#efb73e"),
    "channel-5": ("#56b4e9", "#9bd6fa"),
    "step-0": ("#75d054", "#31688e"),
    "step-1": ("#42be71", "#287d8e"),
    "step-2": ("#22a785", "#20938c"),
    "step-3": ("#218e8d", "#22a785"),
    "step-4": ("#2a768e", "#3dbc74"),
    "step-5": ("#355e8d", "#6ccd5a"),
    "step-6": ("#414487", "#a5db36"),
    "step-7": ("#472777", "#dfe318"),
}
COLOUR = {name: light for name, (light, _) in PALETTE.items()}
CHANNELS = tuple(COLOUR[f"channel-{i}"] for i in range(6))
STEPS = tuple(COLOUR[f"step-{i}"] for i in range(8))


def sequence(count: int) -> list[str]:
    """Return `count` colours in order, the newest standing out most."""
    last = len(STEPS) - 1
    return [
        STEPS[round(i * last / max(count - 1, 1))] if count > 1 else STEPS[-2] for i in range(count)
    ]


def variables(*, dark: bool) -> str:
    """Return the palette as CSS custom properties."""
    return " ".join(f"--{name}: {pair[dark]};" for name, pair in PALETTE.items())


def follow_page(svg: str) -> str:
    """Return a figure that takes its colours from the page, so that it turns dark with it."""
    names = {light: name for name, light in COLOUR.items()}
    pattern = re.compile("|".join(map(re.escape, names)))
    return pattern.sub(lambda found: f"var(--{names[found[0]]})", svg)
