# SPDX-License-Identifier: Apache-2.0
"""From samples to contacts and events, live or on a recording."""
