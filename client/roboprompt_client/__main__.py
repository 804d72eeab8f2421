"""`python -m roboprompt_client`: as `roboprompt-robot`."""

import sys

from roboprompt_client.cli import main

sys.exit(main())
