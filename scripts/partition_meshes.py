"""The meshes on which partitioners are compared: a graded connecting rod, a cube, and two CAD parts of Debian's occt-misc."""
import pathlib
import subprocess
import sys

import numpy as np

CAD = pathlib.Path("/usr/share/opencascade/data/occ")


def write_cube(path, cells):
    """A cube of cells^3 cells of six tetrahedra, as Medit's text."""
    side = cells + 1
    ticks = np.arange(side) / cells
    points = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), -1).reshape(-1, 3)
    corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), -1).reshape(-1, 3)
    number = lambda c: (c[:, 0] * side + c[:, 1]) * side + c[:, 2] + 1
    lists = []
    for axes in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        place, nodes = corner.copy(), [number(corner)]
        for axis in axes:
            place[:, axis] += 1
            nodes.append(number(place))
        lists.append(np.stack(nodes, 1))
    tets = np.stack(lists, 1).reshape(-1, 4)
    with open(path, "w") as file:
        file.write(f"MeshVersionFormatted 2\nDimension 3\nVertices\n{len(points)}\n")
        np.savetxt(file, np.column_stack([points, np.zeros(len(points))]), fmt="%.17g %.17g %.17g %d")
        file.write(f"Tetrahedra\n{len(tets)}\n")
        np.savetxt(file, np.column_stack([tets, np.ones(len(tets), dtype=int)]), fmt="%d")
        file.write("End\n")


def write_rod(path, size):
    """A connecting rod: a disc, a thin web with a rib, a small hub, two holes; elements grow threefold from hub to disc."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("General.NumThreads", 1)
    occ = gmsh.model.occ
    disc, hub = occ.addCylinder(0, 0, 0, 0, 0, 0.5, 1.0), occ.addCylinder(4, 0, 0, 0, 0, 0.8, 0.7)
    web, rib = occ.addBox(0.5, -0.35, 0.1, 3.0, 0.7, 0.25), occ.addBox(1.0, -0.08, 0.3, 2.5, 0.16, 0.35)
    body, _ = occ.fuse([(3, disc)], [(3, web), (3, hub), (3, rib)])
    holes = [(3, occ.addCylinder(0, 0, -1, 0, 0, 3, 0.55)), (3, occ.addCylinder(4, 0, -1, 0, 0, 3, 0.35))]
    occ.cut(body, holes)
    occ.synchronize()
    field = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(field, "F", f"{size}*(0.6+0.35*Sqrt((x-4)^2+y^2+z^2))")
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    for name, value in (("MeshSizeExtendFromBoundary", 0), ("MeshSizeFromPoints", 0), ("Algorithm3D", 10), ("RandomSeed", 1)):
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(path))
    gmsh.finalize()


def make(name, folder, meshtool):
    """The mesh of that name, or of that file, as folder/NAME.h5; made where it is not there yet."""
    target = folder / f"{pathlib.Path(name).stem}.h5"
    if target.exists():
        return target
    convert = [str(meshtool), "convert"]
    if name == "cube":
        source = folder / "cube.mesh"
        write_cube(source, 46)
        command = [*convert, source, target]
    elif name == "rod":
        source = folder / "rod.msh"
        write_rod(source, 0.0262)
        command = [*convert, source, target]
    elif name in ("crank-arm", "housing"):
        cad, size = (CAD / "CrankArm.brep", 1.0) if name == "crank-arm" else (CAD / "Top.brep", 1.3)
        if not cad.exists():
            sys.exit(f"{cad} is missing; run scripts/install (package occt-misc)")
        command = [*convert, cad, target, "--size", str(size)]
    else:
        command = [*convert, name, target]
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return target
