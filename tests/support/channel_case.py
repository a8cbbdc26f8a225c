"""A plane channel that polymer fills at a constant flow, for tests of inject.

Between plates at the distance H, a flow U on average loses dp/dx = 12 eta U / H^2; while polymer drives air out, the pressure
at a gate of constant flow grows by dp/dx U a second.
"""
from box_msh import BoxMesh

ETA, U, H = 1000.0, 0.02, 0.004
SLOPE = 12 * ETA * U / H ** 2  # Pa/m

CHANNEL = f"""[mesh]
file = channel.msh
[fluid.polymer]
viscosity = {ETA}
[inlet.gate]
group = cavity_x_low
fluid = polymer
flow_rate = {U * H}
[vent.outlet]
group = cavity_x_high
[wall.lower]
group = cavity_y_low
[wall.upper]
group = cavity_y_high
"""
AIR = "[fluid.air]\nviscosity = 0.1\n[initial]\nfluid = air\n[initial.start]\nfluid = polymer\nlevel_set = \"0.004 - x\"\n"


def channel_mesh(path, across, length=4.0):
    """length: in heights."""
    mesh = BoxMesh(2)
    mesh.add("cavity", [0.0, 0.0], [length * H, H], [max(4, int(length * across)), across])
    mesh.write(path)
