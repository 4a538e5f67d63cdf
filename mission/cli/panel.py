"""The live view's picture of one scene, drawn with rich."""

from __future__ import annotations

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from mission.cli.scene import Next, Scene

KEYS = "p pause · r resume · s step · a abort · Ctrl-C abort and land"
ROWS_NEXT = 5
ROWS_EVENTS = 5


def draw(scene: Scene, question: str | None = None, said: str = "", footer: str = "") -> RenderableType:
    """One panel, sixty columns or wider. said: the answer to the operator's last key."""
    rows = Table.grid(padding=(0, 1), expand=True)
    rows.add_column(style="dim", width=9)
    rows.add_column(ratio=1)
    rows.add_row("state", _state(scene))
    rows.add_row("time", _time(scene))
    rows.add_row("blade", _blade(scene))
    rows.add_row("distance", _distance(scene))
    rows.add_row("vision", _vision(scene))
    rows.add_row("vehicle", _vehicle(scene))
    rows.add_row("", "")
    rows.add_row("next", _next(scene.following))
    rows.add_row("", "")
    rows.add_row("events", _events(scene.events))
    parts: list[RenderableType] = [rows, *(Text(f"  {alarm}", "bold white on red") for alarm in scene.alarms)]
    if said:
        parts.append(Text(f"  {said}", "bold cyan"))
    if question is not None:
        parts.append(Panel(Text.assemble((question, "bold"), "  y / n"), border_style="yellow"))
    how = f"simulated × {scene.speed:.3g}" if scene.simulated else "[bold red]real vehicle[/]"
    return Panel(
        Group(*parts),
        title=f"[bold]{scene.mission}[/] · {clock(scene.now_s)} · {how}",
        title_align="left",
        subtitle=f"[dim]{KEYS}{'  ' + footer if footer else ''}[/]",
        subtitle_align="left",
        border_style="yellow" if scene.paused or question is not None else "cyan",
    )


def clock(seconds: float) -> str:
    """Mission time as minutes and seconds."""
    return f"{int(seconds) // 60:d}:{int(seconds) % 60:02d}"


def _state(scene: Scene) -> Text:
    *around, leaf = scene.state.split(".")
    text = Text.assemble(*((f"{name} › ", "dim") for name in around), (leaf, "bold green"))
    if scene.paused:
        text.append("  paused", "bold yellow")
    if scene.autonomy != "full":
        text.append(f"  autonomy {scene.autonomy}", "yellow")
    if scene.doing:
        text.append(f"  {scene.doing}", "default")
    elif scene.behaviour:
        text.append(f"  {scene.behaviour}", "dim")
    if scene.recording:
        text.append(f"  ● recording {scene.recording}", "red")
    return text


def _time(scene: Scene) -> RenderableType:
    spent = max(scene.now_s - scene.entered_s, 0.0)
    if scene.deadline_s is None:
        return Text(f"{spent:.0f} s, no deadline", "dim")
    allowed = max(scene.deadline_s - scene.entered_s, 1e-6)
    style = "red" if spent > 0.8 * allowed else "green"
    return _beside(
        ProgressBar(total=allowed, completed=min(spent, allowed), complete_style=style, finished_style="red"),
        f"{spent:.0f} of {allowed:.0f} s",
    )


def _blade(scene: Scene) -> RenderableType:
    if scene.station_m is None or scene.tip_m <= scene.root_m:
        return Text("not at the blade", "dim")
    return _beside(_Span(scene), f"{scene.station_m:.1f} of {scene.tip_m:.1f} m")


class _Span:
    """root ├──────●╌╌╌╌╌┤ tip, as wide as there is room."""

    def __init__(self, scene: Scene) -> None:
        self._share = (scene.station_m or 0.0) - scene.root_m
        self._share = min(max(self._share / (scene.tip_m - scene.root_m), 0.0), 1.0)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = max(options.max_width - 12, 10)
        at = round(self._share * (width - 1))
        yield Text.assemble(
            ("root ├", "dim"), ("━" * at, "cyan"), ("●", "bold cyan"), ("╌" * (width - 1 - at), "dim"), ("┤ tip", "dim")
        )


def _beside(bar: RenderableType, text: str) -> Table:
    row = Table.grid(padding=(0, 2), expand=True)
    row.add_column(ratio=1)
    row.add_column(width=16, justify="right")
    row.add_row(bar, text)
    return row


def _distance(scene: Scene) -> Text:
    if scene.distance_m is None:
        return Text("nothing measured", "dim")
    text = Text(f"{scene.distance_m:.2f}", "bold")
    text.append(f" ± {scene.sigma_m:.2f} m" if scene.sigma_m is not None else " m", "default")
    if scene.target_m is not None:
        off = abs(scene.distance_m - scene.target_m)
        text.append(f"   wanted {scene.target_m:.2f}", "red" if off > 0.5 else "dim")
    if scene.nearest_m is not None:
        text.append(f"   nearest {scene.nearest_m:.2f}", "dim")
    return text


def _vision(scene: Scene) -> Text:
    if scene.vision_age_s is None:
        return Text("not watching", "dim")
    stale = scene.vision_age_s > 1.0
    text = Text(f"{scene.vision_age_s:.1f} s ago", "bold red" if stale else "default")
    if scene.vision_hz is not None:
        text.append(f"   {scene.vision_hz:.1f} a second", "dim")
    return text


def _vehicle(scene: Scene) -> Text:
    text = Text(scene.mode or "?", "bold")
    if scene.battery_percent is not None and scene.battery_percent == scene.battery_percent:
        text.append(f"   battery {scene.battery_percent:.0f} %", "red" if scene.battery_percent < 30 else "default")
    if scene.height_m is not None and scene.height_m == scene.height_m:
        text.append(f"   {scene.height_m:.0f} m up")
    if scene.wind_m_s is not None:
        text.append(f"   wind {scene.wind_m_s:.1f} m/s from {scene.wind_from_deg or 0.0:.0f}°")
    if scene.link_age_s is not None and scene.link_age_s > 0.5:
        text.append(f"   silent for {scene.link_age_s:.1f} s", "bold red")
    return text


def _next(following: tuple[Next, ...]) -> Text:
    if not following:
        return Text("nothing: this is the end", "dim")
    text = Text()
    for number, entry in enumerate(following[:ROWS_NEXT]):
        text.append("\n" if number else "")
        text.append(entry.event, "default").append(" → ", "dim").append(entry.target, "green")
        if entry.blocked_by:
            text.append(f"  {entry.blocked_by}", "yellow")
    if len(following) > ROWS_NEXT:
        text.append(f"\nand {len(following) - ROWS_NEXT} more", "dim")
    return text


def _events(events: tuple[tuple[float, str], ...]) -> Text:
    text = Text()
    for number, (at, what) in enumerate(events[-ROWS_EVENTS:]):
        text.append("\n" if number else "").append(f"{clock(at):>6}  ", "dim").append(what)
    return text
