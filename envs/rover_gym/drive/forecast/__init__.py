"""Networks in files, and the forecast of what becomes of a rover on each arc."""
