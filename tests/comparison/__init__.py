"""What the simulator reaches beside other engines: the chart of error against cost, and the scenes where methods fail."""
