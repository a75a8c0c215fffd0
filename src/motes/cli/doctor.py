"""`motes doctor`: does everything work on this machine?"""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from motes.cli.options import json_option


@click.command(short_help="Look whether everything works on this machine.")
@json_option
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> None:
    """Look at versions, processor, memory, folders, encoders and extras; a fix for each fault."""
    from motes.doctor import examine

    findings = list(examine())
    if as_json:
        click.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        width = max(len(finding.name) for finding in findings)
        for finding in findings:
            mark = "-" if finding.fix else " "
            click.echo(f"{mark} {finding.name:{width}}  {finding.value}")
            if finding.fix:
                click.echo(f"  {'':{width}}  fix: {finding.fix}")
    if any(finding.fix for finding in findings):
        ctx.exit(1)
