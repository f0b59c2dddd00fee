"""Labs of the test suite: found through `ORCLAB_LABS=tests.sample_labs`, never shipped."""

NUMBER = "T"
TITLE = "Test labs"
