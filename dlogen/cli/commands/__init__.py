"""The commands, one module each: `dlogen NAME` is `dlogen.cli.commands.NAME`, its click command is called `command`.

Adding a file adds a command. Modules import click at the top and everything heavy inside the function, since
`dlogen --help` imports all of them.
"""
