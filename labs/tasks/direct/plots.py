"""Plots of how the plan of a direct method is played (`labs.tasks.direct.player`), in collocation,
multiple shooting and the race of direct methods."""

from labs.plots import Line, Plot, TimeSeries


def position_plot(title: str = "Position") -> Plot:
    """With feedback, in open loop, and as planned."""
    return TimeSeries(
        title,
        "{q_unit}",
        Line("q", "q"),
        Line("q_open", r"q^{\text{open}}", "dash"),
        Line("q_plan", r"q^{\text{plan}}", "limit"),
        select="joint",
    )


def control_plot(title: str = "Control") -> Plot:
    """With feedback, and as planned."""
    return TimeSeries(
        title,
        "{u_unit}",
        Line("u", "u"),
        Line("u_plan", r"u^{\text{plan}}", "limit"),
        select="motor",
    )
