"""The machine that carries a mission out: events, deadlines, monitors, clock and journal."""
