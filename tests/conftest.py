"""What all tests share."""

import os

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_state_folder(tmp_path_factory):
    """Keep locks of benches, and what else outlives a run, out of the user's own folder."""
    os.environ["LABDRIVE_STATE"] = str(tmp_path_factory.mktemp("state"))
