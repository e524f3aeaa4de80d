"""Pictures made from the views and their disparity: refocused, faded, moving."""
