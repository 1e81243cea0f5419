# SPDX-License-Identifier: Apache-2.0
"""`touchline init`: a first description of a robot from its model and a recording."""
