"""What a run looks like: frames, figures, pages for the browser, and a live rover."""
