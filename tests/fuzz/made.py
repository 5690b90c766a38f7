"""What only urmpipe or a library writes, made anew for each run."""

from __future__ import annotations

import warnings
from pathlib import Path

from tests.fuzz.corpus import LOG, PATHS, TARGETS, fmus


def make(folder: Path) -> None:
    """Make recordings, tables that are no text, a map, a URDF and an FMU in a folder."""
    import urmpipe
    from urmpipe_pipeline.recording.reader import Store

    warnings.simplefilter("ignore")
    (folder / "path.csv").write_text(PATHS["contour.csv"])
    (folder / "log.csv").write_bytes(LOG.read_bytes())
    (folder / "foreign.fmu").write_bytes(fmus()[1].data)
    (folder / "targets.csv").write_text(TARGETS["xyz.csv"])
    run = urmpipe.ingest(
        folder / "log.csv", robot="ur5e", output=folder / "run.rrd", write_map=folder / "written.toml"
    )
    urmpipe.compare(run, run, output=folder / "comparison.rrd")
    urmpipe.ik(folder / "targets.csv", robot="ur5e", output=folder / "targets.rrd")
    urmpipe.plan(folder / "path.csv", robot="ur5e", tsp=0.05, output=folder / "plan.rrd")
    urmpipe.network_check("four-bar", restarts=1, output=folder / "network.rrd")
    for path in folder.glob("*.rrd"):
        path.with_suffix(".json").write_text(f"{path.name}\n{Store(path).metadata}", encoding="utf-8")
    for suffix in ("parquet", "mat"):
        urmpipe.export(run, folder / f"run.{suffix}")
    _tables(folder)
    from urmpipe_models.robots.urdf_writer import urdf_text

    (folder / "irb60.urdf").write_text(urdf_text(urmpipe.load_robot("irb60")))


def _tables(folder: Path) -> None:
    """Write the same log as the files of NumPy, Arrow and SciPy."""
    import numpy as np
    import pyarrow as pa
    from pyarrow import feather, parquet
    from scipy.io import savemat

    t = np.linspace(0.0, 0.5, 20)
    q = np.sin(t[:, None] + np.arange(6))
    columns = {"t": t, **{f"q{i + 1}": q[:, i] for i in range(6)}}
    table = pa.table(columns)
    feather.write_feather(table, folder / "log.feather", compression="uncompressed")
    feather.write_feather(table, folder / "packed.feather", compression="zstd")
    parquet.write_table(table, folder / "plain.parquet", compression="none", use_dictionary=False)
    savemat(folder / "log.mat", {"t": t, "q": q})
    savemat(folder / "packed.mat", {"log": {"t": t, "q": q}}, do_compression=True)
    np.save(folder / "log.npy", np.column_stack([t, q]))
    rows = list(zip(*columns.values(), strict=True))
    np.save(folder / "records.npy", np.array(rows, [(name, np.float64) for name in columns]))
    np.savez(folder / "log.npz", t=t, q=q)
