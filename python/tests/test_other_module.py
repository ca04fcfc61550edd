# SPDX-License-Identifier: BSD-3-Clause
"""Other modules that are made with pybind11 are what they were before cairn was imported."""

import unittest

import other_module

import cairn


class OtherModule(unittest.TestCase):
    def test_keeps_its_own_exceptions(self):
        with self.assertRaisesRegex(RuntimeError, "the other module's own words"):
            other_module.fail_to_cast()
        with self.assertRaises(TypeError):
            cairn.LandmarkMap.from_arrays()


if __name__ == "__main__":
    unittest.main()
