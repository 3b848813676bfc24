"""The rigid rover and the ground: `rover` reads it, `acceleration` is Eq (8), `statics` the loads, `terrain`."""
