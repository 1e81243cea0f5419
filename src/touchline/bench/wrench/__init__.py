# SPDX-License-Identifier: Apache-2.0
"""The benchmark: the wrench on each segment by every route."""
