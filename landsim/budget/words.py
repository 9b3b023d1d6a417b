"""A budget in words, from budget.json: what the table and the figure both say."""

from collections.abc import Mapping
from typing import Any

from landsim.study.model import READINGS


def signed(value: float, how: str = "g") -> str:
    """A number with a proper minus sign."""
    return f"{value:{how}}".replace("-", "−")


def unit_of(requirement: Mapping[str, Any]) -> str:
    """Of the bound: deg or m."""
    return "deg" if "bound_deg" in requirement else "m"


def amount(value: float, unit: str, how: str = "g") -> str:
    """A number with its unit."""
    return f"{signed(value, how)}{'°' if unit == 'deg' else f' {unit}'}"


def requirement_text(requirement: Mapping[str, Any]) -> str:
    """Quantity, bound and range."""
    unit = unit_of(requirement)
    text = f"{requirement['quantity']} {amount(requirement[f'bound_{unit}'], unit)}"
    return text if requirement["range_m"] is None else f"{text} at {signed(requirement['range_m'])} m"


def setting_text(budget: Mapping[str, Any]) -> str:
    """Camera, runway and approach."""
    camera, runway, approach = budget["camera"], budget["runway"], budget["approach"]
    text = (
        f"{camera['focal_length_mm']:g} mm lens, {camera['width_px']} × {camera['height_px']} pixels of "
        f"{camera['pixel_um']:g} µm, pitched {signed(camera['pitch_early_deg'], '.4g')}°"
    )
    if any(requirement["stage"] != "early" for requirement in budget["requirements"]):
        late, roll = signed(camera["pitch_late_deg"], ".4g"), signed(approach["roll_error_deg"])
        text += f" (late {late}°, roll error {roll}°)"
    slope = signed(approach["glide_slope_deg"])
    return f"{text}; runway {runway['width_m']:g} × {runway['length_m']:g} m; glide slope {slope}°"


def reference_px(budget: Mapping[str, Any]) -> float:
    """The σ of the points that there is: the precision given, or the scenario's noise."""
    return float(budget["precision"]["noise_px"] if "precision" in budget else budget["camera"]["noise_px"])


def binding_text(budget: Mapping[str, Any]) -> str:
    """For each reading the requirement that decides, and whether there is as much precision as it needs."""
    there = reference_px(budget)
    parts = []
    for reading in READINGS:
        row = budget["binding"][reading]
        if row is None:
            continue
        requirement = budget["requirements"][row]
        needed = requirement[reading]["needed_noise_px"]
        name = requirement_text(requirement)
        if needed is None:
            unit = unit_of(requirement)
            shift = requirement[reading][f"roll_shift_{unit}"]
            why = "tell no pose" if shift is None else f"are off by {amount(shift, unit, '.3g')}"
            parts.append(f"{reading}: no precision will do for {name}, since with the roll error perfect lines {why}")
        elif not requirement[reading]["first_order_holds"]:
            text = f"{reading}: {name} decides, with {needed:.3g} px, which drawing does not bear out"
            parts.append(f"{text}: whether {there:.3g} px is enough is open")
        else:
            enough = "is enough" if there <= needed else "is not enough"
            parts.append(f"{reading}: {name} decides, with {needed:.3g} px; {there:.3g} px {enough}")
    return "; ".join(parts)
