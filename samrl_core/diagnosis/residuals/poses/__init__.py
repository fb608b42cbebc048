"""Recordings of poses as residuals: a target seen by a camera, carried or watched by arms."""
