# SPDX-License-Identifier: Apache-2.0
"""The sense of touch for a robot arm without a skin."""
