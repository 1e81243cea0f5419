# SPDX-License-Identifier: Apache-2.0
"""`touchline bench pushes`: arms that move, are not as told, and are pushed time and again."""
