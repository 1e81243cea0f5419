# SPDX-License-Identifier: Apache-2.0
"""The experiments of Iskandar et al., ICRA 2021, again, with numbers and the truth beside them."""
