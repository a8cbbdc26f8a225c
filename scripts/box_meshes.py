"""Rectangles of triangles in MSH 2.2, for scenes that need no mesher: bodies of cells in rows, their sides as groups."""


class Boxes:
    """Each box is a body of its name; its sides are NAME_x_low, NAME_x_high, NAME_y_low, NAME_y_high."""

    def __init__(self):
        self.nodes, self.lines, self.names = [], [], []

    def group(self, dim, name):
        self.names.append((dim, name))
        return len(self.names)

    def add(self, name, xs, ys):
        """A body whose cells lie between the lines x = xs and y = ys."""
        first, nx, ny = len(self.nodes) + 1, len(xs) - 1, len(ys) - 1
        self.nodes += [(x, y) for y in ys for x in xs]
        at = lambda i, j: first + j * (nx + 1) + i  # noqa: E731
        body = self.group(2, name)
        sides = {side: self.group(1, f"{name}_{side}") for side in ("x_low", "x_high", "y_low", "y_high")}
        for j in range(ny):
            for i in range(nx):
                a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
                # The diagonal changes its way, so that no corner's element has all its nodes on the boundary.
                halves = ((a, b, c), (a, c, d)) if (i + j) % 2 == 0 else ((a, b, d), (b, c, d))
                self.lines += [(2, body, half) for half in halves]
        self.lines += [(1, sides["y_low"], (at(i, 0), at(i + 1, 0))) for i in range(nx)]
        self.lines += [(1, sides["y_high"], (at(i, ny), at(i + 1, ny))) for i in range(nx)]
        self.lines += [(1, sides["x_low"], (at(0, j), at(0, j + 1))) for j in range(ny)]
        self.lines += [(1, sides["x_high"], (at(nx, j), at(nx, j + 1))) for j in range(ny)]

    def write(self, path):
        names = "".join(f'{dim} {k + 1} "{name}"\n' for k, (dim, name) in enumerate(self.names))
        nodes = "".join(f"{k + 1} {x:.17g} {y:.17g} 0\n" for k, (x, y) in enumerate(self.nodes))
        cells = "".join(f"{k + 1} {dim} 2 {group} {group} {' '.join(map(str, corners))}\n"
                        for k, (dim, group, corners) in enumerate(self.lines))
        path.write_text(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{len(self.names)}\n{names}$EndPhysicalNames\n"
                        f"$Nodes\n{len(self.nodes)}\n{nodes}$EndNodes\n$Elements\n{len(self.lines)}\n{cells}$EndElements\n")
        return path


def evenly(low, high, cells):
    return [low + (high - low) * k / cells for k in range(cells + 1)]
