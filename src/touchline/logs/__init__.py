# SPDX-License-Identifier: Apache-2.0
"""Recordings of robots: reading tables and rosbag2, writing tables and results."""

from touchline.logs.log import Log, open_log, read_log
from touchline.logs.tables import table_columns, write_table
from touchline.logs.writer import EstimateWriter, TableWriter, remove_results

__all__ = [
    "EstimateWriter",
    "Log",
    "TableWriter",
    "open_log",
    "read_log",
    "remove_results",
    "table_columns",
    "write_table",
]
