"""Small meshes for system tests, as MSH 2.2 text, made without the programs under test."""
import itertools


class SmallMesh:
    """Nodes from 1 with points of three numbers; elements as (type, physical tag, nodes); names as {(dim, tag): name}."""

    def __init__(self, nodes, elements, names):
        self.nodes, self.elements, self.names = nodes, elements, names

    def msh(self):
        names = "".join(f'{dim} {tag} "{name}"\n' for (dim, tag), name in self.names.items())
        nodes = "".join(f"{i} {x!r} {y!r} {z!r}\n" for i, (x, y, z) in self.nodes.items())
        elements = "".join(f"{i} {kind} 2 {tag} {tag} {' '.join(map(str, corners))}\n"
                           for i, (kind, tag, corners) in enumerate(self.elements, 1))
        return (f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{len(self.names)}\n{names}$EndPhysicalNames\n"
                f"$Nodes\n{len(self.nodes)}\n{nodes}$EndNodes\n$Elements\n{len(self.elements)}\n{elements}$EndElements\n")


def box(dim, cells, size=1.0):
    """A square or cube of cells^dim cells in simplices of positive volume: region `body`, groups `low` and `high` along
    the last axis, `side` around."""
    m = cells + 1
    number = lambda corner: 1 + sum(c * m**a for a, c in enumerate(corner))
    corners = list(itertools.product(range(m), repeat=dim))
    h = size / cells
    nodes = {number(c): tuple(c[a] * h if a < dim else 0.0 for a in range(3)) for c in corners}
    elements, facets = [], []
    for cell in itertools.product(range(cells), repeat=dim):
        for axes in itertools.permutations(range(dim)):
            path = [cell]
            for axis in axes:
                path.append(tuple(c + (a == axis) for a, c in enumerate(path[-1])))
            facets += [(dim - 1, tag, [number(c) for c in side]) for tag, side in sides(dim, cells, path)]
            odd = sum(axes[i] > axes[j] for i in range(dim) for j in range(i + 1, dim)) % 2 == 1
            if odd:
                path[0], path[1] = path[1], path[0]
            elements.append((4 if dim == 3 else 2, 1, [number(c) for c in path]))
    names = {(dim, 1): "body", (dim - 1, 1): "low", (dim - 1, 2): "high", (dim - 1, 3): "side"}
    return SmallMesh(nodes, facets + elements, names)


def sides(dim, cells, path):
    """(tag, corners) of the faces of a simplex that lie on the box."""
    for axis in range(dim):
        for plane in (0, cells):
            side = [corner for corner in path if corner[axis] == plane]
            if len(side) == dim:
                yield (3 if axis < dim - 1 else 1 if plane == 0 else 2), side
