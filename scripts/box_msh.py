"""Boxes of triangles or tetrahedra as MSH 2.2 files, for scenes and tests that need no mesher."""
import itertools


def evenly(low, high, cells):
    return [low + (high - low) * k / cells for k in range(cells + 1)]


class BoxMesh:
    """Boxes that share no nodes. Each is a physical group `name`, with faces name_x_low, name_x_high, name_y_low, ..."""

    def __init__(self, dim):
        self.dim = dim
        self.points = []
        self.cells = []  # (group, nodes)
        self.facets = []
        self.names = []  # (dimension, name), the number of a group is its place from 1

    def group(self, dim, name):
        if (dim, name) not in self.names:
            self.names.append((dim, name))
        return self.names.index((dim, name)) + 1

    def add(self, name, low, high, cells):
        """cells: along each axis, all of one size."""
        self.add_lines(name, [evenly(*axis) for axis in zip(low, high, cells)])

    def add_lines(self, name, lines):
        """Cells between these coordinates along each axis. Kuhn's division, so that neighbours conform."""
        dim, first = self.dim, len(self.points)
        cells = [len(axis) - 1 for axis in lines]
        number = {}
        for index in itertools.product(*(range(n + 1) for n in cells)):
            number[index] = first + len(number) + 1
            self.points.append([axis[i] for axis, i in zip(lines, index)])
        volume = self.group(dim, name)
        for corner in itertools.product(*(range(n) for n in cells)):
            for axes in itertools.permutations(range(dim)):
                path = [tuple(corner)]
                for axis in axes:
                    path.append(tuple(c + (a == axis) for a, c in enumerate(path[-1])))
                self.cells.append((volume, [number[p] for p in path]))
                for axis in range(dim):
                    for at, side in ((0, "low"), (cells[axis], "high")):
                        face = [number[p] for p in path if p[axis] == at]
                        if len(face) == dim:
                            self.facets.append((self.group(dim - 1, f"{name}_{'xyz'[axis]}_{side}"), face))

    def write(self, path):
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(self.names))]
        lines += [f'{dim} {i} "{name}"' for i, (dim, name) in enumerate(self.names, 1)]
        lines += ["$EndPhysicalNames", "$Nodes", str(len(self.points))]
        lines += [f"{i} " + " ".join(repr(float(c)) for c in (p + [0.0])[:3]) for i, p in enumerate(self.points, 1)]
        lines += ["$EndNodes", "$Elements", str(len(self.cells) + len(self.facets))]
        kinds = {2: 1, 3: 2}  # nodes of a facet -> gmsh type; cells have one node more
        elements = [(kinds[self.dim], g, n) for g, n in self.facets]
        elements += [({2: 2, 3: 4}[self.dim], g, n) for g, n in self.cells]
        lines += [f"{i} {t} 2 {g} {g} " + " ".join(map(str, n)) for i, (t, g, n) in enumerate(elements, 1)]
        lines += ["$EndElements", ""]
        with open(path, "w") as file:
            file.write("\n".join(lines))
        return path
