"""What users look at after a filling: weld lines, loads of the walls, where the error comes from."""
import pathlib
import tempfile
import unittest

import h5py
import numpy as np

from channel_case import AIR, CHANNEL, ETA, H, U, channel_mesh
from runs import history, run, summary

VOID = AIR.replace("viscosity = 0.1", "law = void")


def last_fields(output):
    """Fields of the last output of one rank, by name."""
    newest = sorted(pathlib.Path(output).glob("*.fields/*"))[-1]
    with h5py.File(newest) as file:
        (part,) = file.values()
        return {name: values[:] for name, values in part.items()}


class Results(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def fill(self, text, *options):
        case = self.directory / "case.ini"
        case.write_text(text)
        run("inject", case, self.directory / "out", *options)
        return self.directory / "out"

    def test_a_front_of_endless_substeps_is_refused(self):
        channel_mesh(self.directory / "channel.msh", 4)
        case = self.directory / "case.ini"
        case.write_text(CHANNEL + AIR + "[time]\nend = 0.1\nstep = 0.05\n[front]\ncfl = 1e-5\n")
        for ranks in (1, 3):
            refused = run("inject", case, self.directory / "refused", ranks=ranks, check=False)
            self.assertEqual(refused.returncode, 3)
            self.assertRegex(refused.stderr, "front would need .* substeps .* shorten")

    def test_fronts_that_meet_leave_a_weld_line(self):
        channel_mesh(self.directory / "channel.msh", 6)
        other = f"[inlet.other]\ngroup = cavity_x_high\nfluid = polymer\nflow_rate = {U * H}\n"
        text = CHANNEL.replace("[vent.outlet]\ngroup = cavity_x_high\n", other)
        for wall in ("lower", "upper"):
            text = text.replace(f"[wall.{wall}]", f"[wall.{wall}]\ncondition = slip")
        fields = last_fields(self.fill(text + VOID.split("[initial.start]")[0] + "[air]\ntrapped = vented\n"))
        x, angle, time = fields["points"][:, 0], fields["weld_angle"], fields["fill_time"]
        middle = np.isclose(x, 2 * H)
        self.assertGreater(angle[middle].min(), 120)
        self.assertGreater(np.median(angle[middle]), 170)
        self.assertEqual(angle[np.abs(x - 2 * H) > 0.3 * H].max(), 0)
        early = np.minimum(x, 4 * H - x) < 1.3 * H
        np.testing.assert_allclose(time[early], np.minimum(x, 4 * H - x)[early] / U, atol=0.05 * H / U)

    def test_walls_bear_what_the_closed_form_says(self):
        across = 6
        channel_mesh(self.directory / "channel.msh", across)
        output = self.fill(CHANNEL + VOID + "[time]\nend = 0.35\n")
        row, before = history(output)[-1], history(output)[-2]
        front = H + U * before["time_s"]
        self.assertLess(abs(row["clamp_force_y_N"] / (row["pressure_gate_Pa"] * front / 2) - 1), 0.06)
        self.assertEqual(row["clamp_force_x_N"], 0)
        fields = last_fields(output)
        x, y = fields["points"][:, 0], fields["points"][:, 1]
        wall = (np.isclose(y, 0) | np.isclose(y, H)) & (x > 0) & (x < 1.5 * H)
        in_wall_elements = 6 * ETA * U / H * (1 - 1 / across)  # the mean over the element
        np.testing.assert_allclose(fields["wall_shear_stress"][wall], in_wall_elements, rtol=0.03)
        self.assertEqual(fields["wall_shear_stress"][np.isclose(y, H / 2)].max(), 0)
        np.testing.assert_allclose(fields["shear_rate"], np.sqrt(3) * fields["strain_rate"], rtol=1e-5)

    def test_the_error_budget_names_its_sources(self):
        channel_mesh(self.directory / "channel.msh", 3)
        case = CHANNEL + VOID + "[time]\nincrements = 4\n"
        coarse = {share["source"]: share for share in summary(self.fill(case))["accuracy"]["error_budget"]}
        self.assertLessEqual({"front", "volume", "frozen flow", "wall resolution", "linear"}, coarse.keys())
        self.assertGreater(coarse["wall resolution"]["relative"], 0.05)
        fine = self.fill(case, "-D", "front.cfl=0.25")
        shares = {share["source"]: share for share in summary(fine)["accuracy"]["error_budget"]}
        self.assertAlmostEqual(shares["front"]["relative"], coarse["front"]["relative"] / 4)


if __name__ == "__main__":
    unittest.main()
