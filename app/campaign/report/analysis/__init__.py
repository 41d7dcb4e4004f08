"""What a campaign's rows come to: functions of arrays, from bounds of a rate to the comparison of two campaigns."""
