"""What the mesh scripts of the cases share: a gmsh model, named groups, sizes, the file written."""
import argparse
import contextlib
import math
import os
import pathlib
import sys

import gmsh

RIGHT_ANGLE = math.pi / 2


def run(script, description, sizes, make, files=None):
    """The command line of a mesh script: makes one file as asked by --output, or else every file that the case needs.

    sizes: name -> (default, help) of the numbers that an option sets. make: writes the mesh for the parsed arguments.
    files: name of a file -> defaults that differ for it; by default one file, named like the folder of the script.
    """
    here = pathlib.Path(script).resolve().parent
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    for name, (default, text) in sizes.items():
        parser.add_argument("--" + name, type=type(default), default=default, help=text)
    parser.add_argument("-o", "--output", type=pathlib.Path, help="the one file to write, instead of the case's own")
    parser.add_argument("--directory", type=pathlib.Path, default=here, help="where the case's own files are written")
    parser.add_argument("--msh-version", choices=["2.2", "4.1"], default="4.1", help="version of the MSH format")
    parser.add_argument("--ascii", action="store_true", help="write text instead of binary")
    args = parser.parse_args()
    if args.output:
        make(args)
        return
    for name, defaults in (files or {here.name + ".msh": {}}).items():
        parser.set_defaults(**{key: default for key, (default, _) in sizes.items()} | defaults | {"output": args.directory / name})
        make(parser.parse_args())


@contextlib.contextmanager
def model(args):
    """An empty gmsh model on one thread, so that the same call makes the same mesh. gmsh 4.8 throws plain strings."""
    gmsh.initialize()
    try:
        options = {"General.Terminal": 0, "General.NumThreads": 1, "Mesh.MshFileVersion": float(args.msh_version),
                   "Mesh.Binary": 0 if args.ascii else 1, "Mesh.Algorithm": 6, "Mesh.Algorithm3D": 1}
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        yield gmsh.model
    except Exception as error:
        sys.exit(f"gmsh: {error} {gmsh.logger.getLastError()}")
    finally:
        gmsh.finalize()


def group(dim, entities, name):
    """Makes a physical group; case files use its name."""
    if not entities:
        sys.exit(f"no face or volume for the group '{name}'")
    tag = gmsh.model.addPhysicalGroup(dim, sorted(entities))
    gmsh.model.setPhysicalName(dim, tag, name)


def boundary_groups(dim, named, rest, skip=()):
    """Names boundary entities by a rule and the others `rest`.

    named: list of (name, predicate of the entity's centre of mass); the first rule that holds gives the name.
    skip: entities inside the domain, which get no name.
    """
    members = {name: [] for name, _ in named} | {rest: []}
    for _, entity in gmsh.model.getEntities(dim - 1):
        if entity in skip:
            continue
        centre = gmsh.model.occ.getCenterOfMass(dim - 1, entity)
        name = next((name for name, rule in named if rule(*centre)), rest)
        members[name].append(entity)
    for name, entities in members.items():
        if entities or name != rest:
            group(dim - 1, entities, name)


def generate(args, dim, largest, smallest=0.0, optimise=False):
    """Meshes with sizes in [smallest, largest], writes the file and prints what it holds."""
    gmsh.option.setNumber("Mesh.CharacteristicLengthMax", largest)
    gmsh.option.setNumber("Mesh.CharacteristicLengthMin", smallest)
    gmsh.model.mesh.generate(dim)
    if optimise:
        improve()
    args.output.parent.mkdir(parents=True, exist_ok=True)
    gmsh.write(str(args.output))
    nodes = len(gmsh.model.mesh.getNodes()[0])
    elements = sum(len(tags) for tags in gmsh.model.mesh.getElements(dim)[1])
    print(f"{os.path.relpath(args.output)}: {nodes} nodes, {elements} {'triangles' if dim == 2 else 'tetrahedra'}")


def improve():
    """Optimises a mesh of tetrahedra; Debian's gmsh has its own passes only."""
    gmsh.option.setNumber("Mesh.OptimizeThreshold", 0.6)
    for method in ("", "Relocate3D", ""):
        gmsh.model.mesh.optimize(method)
