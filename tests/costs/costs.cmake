# SPDX-License-Identifier: BSD-3-Clause
# How long the longest tests take, in seconds: CTest starts them first, so that all processors end together. A run
# before knows better, but a clean checkout has none. Tests that this build does not have are ignored.
foreach(cost_and_tests IN ITEMS
    "100 viewer_browser install"
    "50 commands_of_guide MapCliTest"
    "40 PclPeer.ReachesTheSamePoseOnTheRealMap MergeTest.PutsTwoRealSessionsIntoOneFrame faults"
    "30 SimulatedDemoTest.MapsTwoSessionsAndAlignsThemNearTheTruth"
    "25 OdometryPipeline"
    "20 commands_of_README commands_of_tutorial python_alignment RealMapTest.LoopsOfAShortSessionAreClosedAndEveryFrameIsCorrected"
    "20 SimulatedDemoTest.SameBytesWithAnyNumberOfThreads RealMapTest.DeskIsTrackedWholeAndNearTheTruth"
    "20 RealLocateTest.FindsImagesOfAnotherRealSession"
    "15 ByParts.AcceptNoTwoPlacesForOneThingThatStandsInBoth LocateCliTest python_atlas"
    "12 mutate_selftest python_pip AtlasCliTest.ProcessesOnOneServerGiveTogetherWhatOneGives"
    "12 RealMapTest.XyzIsNearTheTruth")
  separate_arguments(tests UNIX_COMMAND "${cost_and_tests}")
  list(POP_FRONT tests cost)
  foreach(test IN LISTS tests)
    set_tests_properties(${test} PROPERTIES COST ${cost})
  endforeach()
endforeach()
